// SPDX-License-Identifier: MIT
// The bases by name: single lamps, S-matrices, normalised Hadamard, triangles, harmonics, files.
#include "stage/basis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "stage/basis_file.hpp"
#include "stage/basis_inverse.hpp"
#include "stage/hadamard.hpp"
#include "stage/harmonics.hpp"
#include "stage/projective_space.hpp"
#include "stage/triangles.hpp"

namespace ols {

namespace {

constexpr const char* harmonics_prefix = "spherical_harmonics:";

Basis empty_basis(const std::string& name, int rows, int lamps) {
    Basis basis;
    basis.name = name;
    basis.rows = rows;
    basis.lamps = lamps;
    basis.levels.resize(size_t(rows) * size_t(lamps));
    return basis;
}

void show_first_lamps(Basis& basis, int images) {
    for (int i = 0; i < images; ++i) basis.image_lamps.push_back({i});
    basis.weights.resize(size_t(basis.rows) * size_t(images));
}

Basis single_basis(int lamps) {
    Basis basis = empty_basis("single", lamps, lamps);
    show_first_lamps(basis, lamps);
    for (int i = 0; i < lamps; ++i) basis.levels[size_t(i) * (size_t(lamps) + 1)] = 1;
    std::copy(basis.levels.begin(), basis.levels.end(), basis.weights.begin());
    return basis;
}

// H of order n + 1 normalised, its first row and column left out: S = (J - H) / 2 is an S-matrix of order n, and
// S^-1 = 2 / (n + 1) (2 S' - J): +1 where the lamp is lit, -1 where it is not, scaled by 2 / (n + 1) (Harwit and Sloane,
// "Hadamard Transform Optics", 1979, section 3.2). The inverse row of a lamp needs no other lamp's column, so columns
// beyond the lamps are left out at no loss, and the rows kept are still a left inverse. A lamp beyond the columns stays dark.
Basis s_matrix_basis(const std::string& name, const Signs& h, int lamps) {
    Basis basis = empty_basis(name, h.n - 1, lamps);
    const int images = std::min(lamps, h.n - 1);
    show_first_lamps(basis, images);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < images; ++i) {
            const bool lit = h.at(r + 1, i + 1) < 0;
            basis.levels[size_t(r) * size_t(lamps) + size_t(i)] = lit;
            basis.weights[size_t(r) * size_t(images) + size_t(i)] = lit ? 1 : -1;
        }
    basis.scale = 2.0 / h.n;
    return basis;
}

// P = (J + H) / 2 with H normalised, order n. Let e be the vector of ones and u the first unit vector: H u = e and
// u' H = e', so J = e e' = e u' H and P = (I + e u') H / 2. By Sherman and Morrison (I + e u')^-1 = I - e u' / 2, and
// H' e = H' H u = n u, hence P^-1 = 2/n H' - u u'. In units of 2/n = 1/78 every weight is H's own sign, only the weight
// of row 0 (all lamps lit) for lamp 0 (lit in every row) is 1 - n/2 = -77: lamp 0 alone gains nothing from
// multiplexing, its noise variance is (155 + 77^2) / 78^2 = 1.0 against 1/39 for the others.
Result<Basis> hadamard156_basis(int lamps) {
    Signs h = williamson_156();
    normalise(h);
    if (lamps != h.n)
        return fail(fmt::format(
            "basis hadamard156 is for {} lamps and the stage has {} on its sphere: choose another basis", h.n, lamps));
    Basis basis = empty_basis("hadamard156", h.n, h.n);
    show_first_lamps(basis, h.n);
    for (size_t at = 0; at < basis.levels.size(); ++at) {
        basis.levels[at] = h.signs[at] > 0;
        basis.weights[at] = h.signs[at];
    }
    basis.weights[0] = int8_t(1 - h.n / 2);
    basis.scale = 2.0 / h.n;
    return basis;
}

Basis s155_basis(int lamps) {
    Signs h = williamson_156();
    normalise(h);
    return s_matrix_basis("s155", h, lamps);
}

Basis s159_basis(int lamps) {
    return s_matrix_basis("s159", sylvester_double(paley(79)), lamps);
}

Basis paley163_basis(int lamps) {
    return s_matrix_basis("paley163", paley(163), lamps);
}

// The 156 points and planes of PG(3, 5): 31 points on a plane, 6 on any two, so that N' N = 25 I + 6 J and N J = 31 J, and
// N^-1 = (31 N' - 6 J) / 775: 25 where a lamp is lit, -6 where it is not. Among all lights of 31 lamps a row none leaves less
// noise (stage/design_starts.hpp).
Result<Basis> planes156_basis(int lamps) {
    constexpr int dimension = 3, q = 5, lit_weight = 25, dark_weight = -6;
    const auto points = projective_points(dimension, q, sphere_lamp_count);
    if (lamps != int(points.size()))
        return fail(
            fmt::format("basis planes156 is for {} lamps and the stage has {} on its sphere: choose another basis",
                        points.size(), lamps));
    Basis basis = empty_basis("planes156", lamps, lamps);
    show_first_lamps(basis, lamps);
    for (size_t r = 0; r < points.size(); ++r)
        for (size_t i = 0; i < points.size(); ++i) {
            const bool lit = lies_on(points[i], points[r], q);
            basis.levels[r * points.size() + i] = lit;
            basis.weights[r * points.size() + i] = lit ? lit_weight : dark_weight;
        }
    basis.scale = 1 / 775.0;
    return basis;
}

// Wenger 5.2: each triple stands for one light in the middle of its lamps; nothing is inverted, only divided by three.
Basis triangle_basis(const std::vector<Vec3>& lamps) {
    const auto triples = north_triangles(lamps);
    Basis basis = empty_basis("triangle", int(triples.size()), int(lamps.size()));
    basis.weights.resize(triples.size() * triples.size());
    for (size_t r = 0; r < triples.size(); ++r) {
        basis.image_lamps.emplace_back(triples[r].begin(), triples[r].end());
        for (const int lamp : triples[r]) basis.levels[r * lamps.size() + size_t(lamp)] = 1;
        basis.weights[r * (triples.size() + 1)] = 1;
    }
    basis.scale = 1 / 3.0;
    return basis;
}

Result<Basis> triangle300_basis(const std::vector<Vec3>& lamps) {
    const auto triples = all_triangles(lamps);
    Basis basis = empty_basis("triangle300", int(triples.size()), int(lamps.size()));
    for (size_t r = 0; r < triples.size(); ++r)
        for (const int lamp : triples[r]) basis.levels[r * lamps.size() + size_t(lamp)] = 1;
    return with_least_squares(std::move(basis));
}

Result<Basis> harmonics_basis(const std::string& name, const std::vector<LightPosition>& lamps) {
    const char* digits = name.c_str() + std::string(harmonics_prefix).size();
    int order = -1;
    const auto parsed = std::from_chars(digits, name.c_str() + name.size(), order);
    if (parsed.ec != std::errc() || *parsed.ptr != 0 || order < 0 || order > harmonics_order_max)
        return fail(fmt::format("basis '{}': give an order from 0 to {}, as in {}4", name, harmonics_order_max,
                                harmonics_prefix));
    constexpr int level_max = 255;
    const auto patterns = harmonic_patterns(lamps, order, HarmonicSign::offset, level_max);
    Basis basis = empty_basis(name, int(patterns.size()), int(lamps.size()));
    basis.level_max = level_max;
    for (size_t r = 0; r < patterns.size(); ++r)
        std::copy(patterns[r].levels.begin(), patterns[r].levels.end(),
                  basis.levels.begin() + ptrdiff_t(r * lamps.size()));
    return with_least_squares(std::move(basis));
}

std::vector<Vec3> directions_of(const std::vector<LightPosition>& lamps) {
    std::vector<Vec3> directions;
    for (const auto& lamp : lamps) directions.push_back(lamp.direction);
    return directions;
}

Result<Basis> for_lamps(int lamps, int most, const std::string& name, Basis (*make)(int)) {
    if (lamps <= most) return make(lamps);
    return fail(fmt::format("basis {} is for {} lamps and the stage has {} on its sphere: choose another basis", name,
                            most, lamps));
}

}  // namespace

double noise_variance(const Basis& basis, int image) {
    double sum = 0;
    for (int r = 0; r < basis.rows; ++r) sum += basis.inverse(r, image) * basis.inverse(r, image);
    return sum;
}

std::vector<LightPosition> image_lights(const Basis& basis, const std::vector<LightPosition>& lamps) {
    std::vector<LightPosition> lights;
    for (const auto& shown : basis.image_lamps) {
        LightPosition light{"", {}};
        for (const int lamp : shown) {
            light.name += (light.name.empty() ? "" : "+") + lamps[size_t(lamp)].name;
            light.direction = light.direction + lamps[size_t(lamp)].direction;
        }
        light.direction = normalized(light.direction);
        lights.push_back(std::move(light));
    }
    return lights;
}

const std::vector<BasisKind>& basis_kinds() {
    static const std::vector<BasisKind> kinds = {
        {"single", "one lamp a row (Wenger 5.1)"},
        {"triangle", "each north-pointing triple of lamps is one light of the result (Wenger 5.2)"},
        {"triangle300", "all triples of neighbours, inverted to single lamps by least squares"},
        {"planes156", "31 lamps a row, the planes of a projective space: least noise for 2 to 200 counts a lamp"},
        {"s159", "S-matrix of 159 rows, three columns to spare: a lost slot can be filled in"},
        {"hadamard156", "normalised Hadamard matrix of order 156 by Williamson"},
        {"s155", "S-matrix of 155 rows and lamps (Wenger 5.3); the last lamp stays dark"},
        {"paley163", "S-matrix of 163 rows, seven columns to spare; needs a longer cycle"},
        {std::string(harmonics_prefix) + "ORDER", "grey spherical harmonics up to ORDER, offset to be positive"},
        {"FILE.csv", "levels from a file, a row a line, inverted by least squares"}};
    return kinds;
}

Status check_basis_name(const std::string& name) {
    std::string known;
    for (const auto& kind : basis_kinds()) {
        if (kind.name == name) return Done{};
        known += (known.empty() ? "" : ", ") + kind.name;
    }
    if (name.starts_with(harmonics_prefix) || name.ends_with(".csv")) return Done{};
    return fail("there is no lighting basis '" + name + "': choose one of " + known);
}

Result<Basis> find_basis(const std::string& name, const std::vector<LightPosition>& lamps) {
    const auto directions = directions_of(lamps);
    const int count = int(lamps.size());
    if (name == "single") return single_basis(count);
    if (name == "planes156") return planes156_basis(count);
    if (name == "s159") return for_lamps(count, 159, name, s159_basis);
    if (name == "paley163") return for_lamps(count, 163, name, paley163_basis);
    if (name == "s155") return for_lamps(count, 156, name, s155_basis);
    if (name == "hadamard156") return hadamard156_basis(count);
    if (name == "triangle" || name == "triangle300") {
        if (north_triangles(directions).empty())
            return fail(
                fmt::format("basis {} is made of neighbouring lamps, and no three of this stage's are: choose "
                            "another basis",
                            name));
        return name == "triangle" ? Result<Basis>(triangle_basis(directions)) : triangle300_basis(directions);
    }
    if (name.starts_with(harmonics_prefix)) return harmonics_basis(name, lamps);
    if (name.ends_with(".csv")) return read_basis(name, count);
    return check_basis_name(name).error();
}

}  // namespace ols
