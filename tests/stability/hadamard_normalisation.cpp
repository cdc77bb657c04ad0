// SPDX-License-Identifier: MIT
// A normalised Hadamard matrix lights lamp 0 in every row: that lamp gains nothing from multiplexing, and formulas for
// S-matrices are wrong about it.
// links: ols_stage Eigen3::Eigen
#include <Eigen/Dense>
#include <algorithm>
#include <random>

#include "hard_case.hpp"
#include "stage/basis_inverse.hpp"
#include "stage/hadamard.hpp"

using namespace ols;

namespace {

constexpr int n = 156;

// (J + H) / 2 of Williamson's matrix as it is.
Basis raw_basis(const Signs& h) {
    Basis basis;
    basis.name = "raw Hadamard";
    basis.rows = basis.lamps = n;
    for (int r = 0; r < n; ++r)
        for (int i = 0; i < n; ++i) basis.levels.push_back(h.at(r, i) > 0);
    return basis;
}

double worst_variance(const Basis& basis) {
    double worst = 0;
    for (int i = 0; i < basis.images(); ++i) worst = std::max(worst, noise_variance(basis, i));
    return worst;
}

}  // namespace

// Bound: P = (e e' + H) / 2, so by Sherman and Morrison P^-1 = 2/n (H' - c p' / (n + s)), where c = H' e are the column
// sums, p = H e the row sums and s = e' H e. With h_i'p = n and |p|^2 = n^2 the squares of its row i sum to
//     4/n^2 (n - 2 n c_i / (n + s) + (n c_i / (n + s))^2).
// Normalised, c_0 = s = n: 1 for lamp 0. Williamson's own columns have sums of a few tens at most.
TEST(HadamardNormalisation, the_raw_matrix_spreads_what_the_normalised_one_puts_on_lamp_0) {
    const Signs h = williamson_156();
    double total = 0, bound = 0;
    std::vector<double> sums(n);
    for (int r = 0; r < n; ++r)
        for (int i = 0; i < n; ++i) sums[size_t(i)] += h.at(r, i), total += h.at(r, i);
    for (const double sum : sums) {
        const double share = n * sum / (n + total);
        bound = std::max(bound, 4.0 / (n * n) * (n - 2 * share + share * share));
    }
    const auto raw = with_least_squares(raw_basis(h));
    ASSERT_TRUE(raw.ok()) << raw.error().message;
    expect_within(
        "Hadamard 156 normalised (naive) or as Williamson gives it: noise variance of the worst lamp, single = 1",
        worst_variance(*find_basis("hadamard156")), worst_variance(*raw), bound * (1 + 1e-9), "");
}

// The S-matrix formula x = 2/n H' y leaves a sum of lamps in lamp 0. Bound: 0, counts are integers and the weights exact.
TEST(HadamardNormalisation, the_formula_for_s_matrices_is_wrong_for_lamp_0) {
    const Basis basis = *find_basis("hadamard156");
    std::mt19937 random(2);
    std::uniform_int_distribution<int> count(0, 100);
    std::vector<int> lamps(n);
    for (int& lamp : lamps) lamp = count(random);
    double naive = 0, ours = 0;
    for (int i = 0; i < n; ++i) {
        long signs = 0, weights = 0;
        for (int r = 0; r < n; ++r) {
            long row = 0;
            for (int j = 0; j < n; ++j) row += basis.lit(r, j) ? lamps[size_t(j)] : 0;
            signs += basis.lit(r, i) ? row : -row, weights += basis.weight(r, i) * row;
        }
        naive = std::max(naive, std::abs(double(signs) * 2 / n - lamps[size_t(i)]));
        ours = std::max(ours, std::abs(double(weights) * basis.scale - lamps[size_t(i)]));
    }
    expect_within("normalised Hadamard 156 inverted as if it were an S-matrix", naive, ours, 0, "counts");
}
