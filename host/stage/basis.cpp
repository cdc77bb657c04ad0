// SPDX-License-Identifier: MIT
// Hadamard matrices by construction (Paley, Sylvester, Williamson), and the 0/1 lighting bases made from them.
//
// H is Hadamard of order n when its entries are +1 and -1 and H H' = n I. Light cannot be negative, so a basis lights
// the lamps where H has one sign. Both inverses below are exact in small integers (Harwit and Sloane, "Hadamard
// Transform Optics", 1979, sections 3.2 and 3.3).
#include "stage/basis.hpp"

#include <string_view>

namespace ols {

namespace {

// A square matrix of +1 and -1.
struct Signs {
    int n = 0;
    std::vector<int8_t> signs;

    explicit Signs(int order) : n(order), signs(size_t(order) * order, 1) {}
    int8_t& at(int row, int column) { return signs[size_t(row) * n + column]; }
    int at(int row, int column) const { return signs[size_t(row) * n + column]; }
};

// Negates columns, then rows, until the first row and the first column are all +1; H H' = n I stays.
void normalise(Signs& h) {
    for (int c = 0; c < h.n; ++c)
        if (h.at(0, c) < 0)
            for (int r = 0; r < h.n; ++r) h.at(r, c) = int8_t(-h.at(r, c));
    for (int r = 0; r < h.n; ++r)
        if (h.at(r, 0) < 0)
            for (int c = 0; c < h.n; ++c) h.at(r, c) = int8_t(-h.at(r, c));
}

// Paley's first construction, order q + 1 for a prime q = 3 mod 4: H = I + [0 1; -1 Q] with Q(i, j) = +1 when i - j is
// a square modulo q, -1 when it is not, 0 on the diagonal (R. Paley, "On orthogonal matrices", 1933).
Signs paley(int q) {
    std::vector<bool> square(q, false);
    for (int i = 1; i < q; ++i) square[size_t(i) * i % q] = true;
    Signs h(q + 1);
    for (int i = 0; i < q; ++i) {
        h.at(i + 1, 0) = -1;
        for (int j = 0; j < q; ++j) h.at(i + 1, j + 1) = i == j || square[(i - j + q) % q] ? 1 : -1;
    }
    normalise(h);
    return h;
}

// [H H; H -H], of twice the order.
Signs sylvester_double(const Signs& h) {
    Signs doubled(2 * h.n);
    for (int r = 0; r < doubled.n; ++r)
        for (int c = 0; c < doubled.n; ++c)
            doubled.at(r, c) = int8_t(h.at(r % h.n, c % h.n) * (r >= h.n && c >= h.n ? -1 : 1));
    return doubled;
}

// Williamson's array [A B C D; -B A -D C; -C D A -B; -D -C B A] of four symmetric circulants of order 39, order 156.
// A half-row holds elements 0..19 of a circulant's first row; symmetry gives the rest: a(k) = a(39 - k).
Signs williamson_156() {
    constexpr int order = 39;
    constexpr std::string_view half_rows[4] = {"+-+-++-+--+--++-----", "+-+-++----+++--++---", "++---+-++++---+---+-",
                                               "+-+++-++------+--+-+"};
    constexpr int block[4][4] = {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 3, 0, 1}, {3, 2, 1, 0}};
    constexpr int sign[4][4] = {{1, 1, 1, 1}, {-1, 1, -1, 1}, {-1, 1, 1, -1}, {-1, -1, 1, 1}};
    Signs h(4 * order);
    for (int r = 0; r < h.n; ++r)
        for (int c = 0; c < h.n; ++c) {
            const int k = (c % order - r % order + order) % order;
            const char element = half_rows[block[r / order][c / order]][k < 20 ? k : order - k];
            h.at(r, c) = int8_t(sign[r / order][c / order] * (element == '+' ? 1 : -1));
        }
    normalise(h);
    return h;
}

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
    const Signs h = williamson_156();
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
