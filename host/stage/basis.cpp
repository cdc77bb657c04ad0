// SPDX-License-Identifier: MIT
// The 0/1 lighting bases made from Hadamard matrices. Light cannot be negative, so a basis lights the lamps where H has
// one sign. Both inverses below are exact in small integers (Harwit and Sloane, "Hadamard Transform Optics", 1979,
// sections 3.2 and 3.3).
#include "stage/basis.hpp"

#include "stage/hadamard.hpp"

namespace ols {

namespace {

Basis empty_basis(const std::string& name, int rows) {
    Basis basis;
    basis.name = name;
    basis.rows = rows;
    basis.lamps = sphere_lamp_count;
    basis.on.resize(size_t(rows) * basis.lamps);
    basis.weights.resize(basis.on.size());
    return basis;
}

Basis single_basis() {
    Basis basis = empty_basis("single", sphere_lamp_count);
    for (int i = 0; i < basis.lamps; ++i)
        basis.on[size_t(i) * basis.lamps + i] = 1, basis.weights[size_t(i) * basis.lamps + i] = 1;
    return basis;
}

// H normalised, its first row and column left out, S = (J - H) / 2 is an S-matrix of order n = 159 and
// S^-1 = 2 / (n + 1) (2 S' - J): +1 where the lamp is lit, -1 where it is not, scaled by 1/80. The inverse row of a
// lamp needs no other lamp's column, so the three columns beyond 156 lamps are left out at no loss: S stays injective
// and the rows kept are still a left inverse.
Basis s159_basis() {
    const Signs h = sylvester_double(paley(79));
    Basis basis = empty_basis("s159", h.n - 1);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) {
            const bool lit = h.at(r + 1, i + 1) < 0;
            basis.on[size_t(r) * basis.lamps + i] = lit;
            basis.weights[size_t(r) * basis.lamps + i] = lit ? 1 : -1;
        }
    basis.scale = 1 / 80.0;
    return basis;
}

// P = (J + H) / 2 with H normalised, order n. Let e be the vector of ones and u the first unit vector: H u = e and
// u' H = e', so J = e e' = e u' H and P = (I + e u') H / 2. By Sherman and Morrison (I + e u')^-1 = I - e u' / 2, and
// H' e = H' H u = n u, hence P^-1 = 2/n H' - u u'. In units of 2/n = 1/78 every weight is H's own sign, only the weight
// of row 0 (all lamps lit) for lamp 0 (lit in every row) is 1 - n/2 = -77: lamp 0 alone gains nothing from
// multiplexing, its noise variance is (155 + 77^2) / 78^2 = 1.0 against 1/39 for the others.
Basis hadamard156_basis() {
    Signs h = williamson_156();
    normalise(h);
    Basis basis = empty_basis("hadamard156", h.n);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) {
            basis.on[size_t(r) * basis.lamps + i] = h.at(r, i) > 0;
            basis.weights[size_t(r) * basis.lamps + i] = int8_t(h.at(r, i));
        }
    basis.weights[0] = int8_t(1 - h.n / 2);
    basis.scale = 2.0 / h.n;
    return basis;
}

}  // namespace

double noise_variance(const Basis& basis, int lamp) {
    int64_t sum = 0;
    for (int r = 0; r < basis.rows; ++r) sum += int64_t(basis.weight(r, lamp)) * basis.weight(r, lamp);
    return basis.scale * basis.scale * double(sum);
}

std::vector<std::string> basis_names() {
    return {"single", "s159", "hadamard156"};
}

Result<Basis> find_basis(const std::string& name) {
    if (name == "single") return single_basis();
    if (name == "s159") return s159_basis();
    if (name == "hadamard156") return hadamard156_basis();
    std::string known;
    for (const auto& n : basis_names()) known += (known.empty() ? "" : ", ") + n;
    return fail("there is no lighting basis '" + name + "': choose one of " + known);
}

}  // namespace ols
