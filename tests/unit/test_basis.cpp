// SPDX-License-Identifier: MIT
// Lighting bases: exact integer inverses, and the condition numbers and noise variances that a singular value
// decomposition, which knows nothing of their construction, finds.
// links: ols_stage Eigen3::Eigen
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numeric>
#include <set>

#include "stage/basis.hpp"
#include "stage/basis_inverse.hpp"

using namespace ols;

namespace {

Eigen::MatrixXd matrix_of(const Basis& basis) {
    Eigen::MatrixXd m(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) m(r, i) = basis.lit(r, i);
    return m;
}

// Least squares by the pseudo-inverse: what any inversion of these rows can reach.
struct Quality {
    double condition, mean_variance;
};

Quality quality_of(const Eigen::MatrixXd& m) {
    const Eigen::VectorXd s = Eigen::BDCSVD<Eigen::MatrixXd>(m).singularValues();
    return {s(0) / s(s.size() - 1), s.array().square().inverse().sum() / double(s.size())};
}

double mean_noise_variance(const Basis& basis) {
    double sum = 0;
    for (int i = 0; i < basis.images(); ++i) sum += noise_variance(basis, i);
    return sum / basis.images();
}

}  // namespace

class EveryBasis : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryBasis, testing::Values("single", "planes156", "s159", "hadamard156", "paley163"));

TEST_P(EveryBasis, weights_times_rows_are_the_identity_in_exact_integers) {
    const Basis basis = *find_basis(GetParam());
    ASSERT_EQ(basis.lamps, 156);
    const long unit = std::lround(1 / basis.scale);
    EXPECT_EQ(1.0 / double(unit), basis.scale);
    for (int i = 0; i < basis.lamps; ++i)
        for (int j = 0; j < basis.lamps; ++j) {
            long sum = 0;
            for (int r = 0; r < basis.rows; ++r) sum += basis.weight(r, i) * long(basis.lit(r, j));
            ASSERT_EQ(sum, i == j ? unit : 0) << "lamps " << i << " and " << j;
        }
}

TEST_P(EveryBasis, no_two_rows_and_no_two_lamps_are_the_same) {
    const Basis basis = *find_basis(GetParam());
    std::set<std::vector<bool>> rows, lamps;
    for (int r = 0; r < basis.rows; ++r) {
        std::vector<bool> row(basis.lamps);
        for (int i = 0; i < basis.lamps; ++i) row[i] = basis.lit(r, i);
        rows.insert(row);
    }
    for (int i = 0; i < basis.lamps; ++i) {
        std::vector<bool> lamp(basis.rows);
        for (int r = 0; r < basis.rows; ++r) lamp[r] = basis.lit(r, i);
        lamps.insert(lamp);
    }
    EXPECT_EQ(int(rows.size()), basis.rows);
    EXPECT_EQ(int(lamps.size()), basis.lamps);
}

TEST_P(EveryBasis, integer_weights_lose_less_than_a_thousandth_of_noise_variance_to_least_squares) {
    const Basis basis = *find_basis(GetParam());
    const double best = quality_of(matrix_of(basis)).mean_variance;
    EXPECT_GE(mean_noise_variance(basis), best * (1 - 1e-9));
    EXPECT_LE(mean_noise_variance(basis), best * 1.001);
}

TEST(Basis, s159_has_159_rows_of_condition_12_5_and_noise_variance_0_0248) {
    const Basis basis = *find_basis("s159");
    EXPECT_EQ(basis.rows, 159);
    const Quality quality = quality_of(matrix_of(basis));
    EXPECT_NEAR(quality.condition, 12.5, 0.1);
    EXPECT_NEAR(quality.mean_variance, 0.0248, 0.0001);
    EXPECT_NEAR(mean_noise_variance(basis), 159 / 6400.0, 1e-12);
}

// Leaving a row out of a least-squares problem adds |column r of the inverse|^2 / (1 - leverage of r). The three columns
// left out of the S-matrix span the left null space; they are +-1 vectors with inner products 159 (same) and -1
// (different), so 1 - leverage is at least 1/3/157 + 8/3/160, and each of 156 lamps has weight 1/80 in row r.
TEST(Basis, s159_keeps_every_lamp_when_any_single_row_is_lost) {
    const Eigen::MatrixXd whole = matrix_of(*find_basis("s159"));
    const double bound = 159 / 6400.0 + 1 / 6400.0 / (1 / 3.0 / 157 + 8 / 3.0 / 160);
    for (int lost = 0; lost < whole.rows(); lost += 23) {
        Eigen::MatrixXd rest(whole.rows() - 1, whole.cols());
        rest << whole.topRows(lost), whole.bottomRows(whole.rows() - 1 - lost);
        EXPECT_LT(quality_of(rest).mean_variance, bound) << "row " << lost;
    }
}

TEST(Basis, hadamard156_cannot_lose_a_row) {
    const Eigen::MatrixXd whole = matrix_of(*find_basis("hadamard156"));
    EXPECT_LT(Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(whole.bottomRows(155)).rank(), 156);
}

TEST(Basis, hadamard156_has_condition_80_and_noise_variance_0_032_because_of_lamp_0_alone) {
    const Basis basis = *find_basis("hadamard156");
    const Quality quality = quality_of(matrix_of(basis));
    EXPECT_NEAR(quality.condition, 80, 1);
    EXPECT_NEAR(quality.mean_variance, 0.032, 0.0005);
    EXPECT_NEAR(noise_variance(basis, 0), (155 + 77 * 77) / (78.0 * 78), 1e-12);
    for (int i = 1; i < 156; ++i) EXPECT_NEAR(noise_variance(basis, i), 1 / 39.0, 1e-12);
}

TEST(Basis, the_signs_behind_hadamard156_are_orthogonal) {
    const Basis basis = *find_basis("hadamard156");
    const Eigen::MatrixXd h = 2 * matrix_of(basis) - Eigen::MatrixXd::Ones(156, 156);
    EXPECT_EQ(h * h.transpose(), 156 * Eigen::MatrixXd::Identity(156, 156));
}

TEST(Basis, multiplexed_rows_light_about_half_of_the_lamps) {
    for (const std::string name : {"s159", "hadamard156"}) {
        const Basis basis = *find_basis(name);
        for (int r = name == "s159" ? 0 : 1; r < basis.rows; ++r) {
            const auto row = basis.levels.begin() + std::ptrdiff_t(r) * basis.lamps;
            const int lit = std::accumulate(row, row + basis.lamps, 0);
            EXPECT_GE(lit, 77) << name << " row " << r;
            EXPECT_LE(lit, 80) << name << " row " << r;
        }
    }
}

// Figures of the decomposition, which knows nothing of the construction.
TEST(Basis, the_others_have_the_condition_and_noise_of_their_matrices) {
    const auto expect = [](const std::string& name, int rows, int images, double condition, double variance) {
        const Basis basis = *find_basis(name);
        EXPECT_EQ(basis.rows, rows) << name;
        EXPECT_EQ(basis.images(), images) << name;
        EXPECT_NEAR(matrix_figures(basis).condition, condition, 0.01 * condition) << name;
        EXPECT_NEAR(mean_noise_variance(basis), variance, 0.01 * variance) << name;
        EXPECT_FALSE(basis.is_estimate) << name;
    };
    expect("s155", 155, 155, 12.5, 0.0255);
    // N' N = 25 I + 6 J: singular values 5, and 31 once; the mean of the inverse squares is (155 / 25 + 1 / 961) / 156.
    expect("planes156", 156, 156, 31 / 5.0, (155 / 25.0 + 1 / 961.0) / 156);
    expect("paley163", 163, 156, 12.5, 0.0242);
    expect("triangle300", 300, 156, 11.1, 0.58);
    expect("triangle", 155, 155, matrix_figures(*find_basis("triangle")).condition, 1 / 9.0);
    EXPECT_EQ(matrix_figures(*find_basis("triangle")).rank, 152);
}

TEST(Basis, harmonics_of_fewer_patterns_than_lamps_are_an_estimate) {
    const Basis basis = *find_basis("spherical_harmonics:10");
    EXPECT_EQ(basis.rows, 121);
    EXPECT_EQ(basis.images(), 156);
    EXPECT_EQ(matrix_figures(basis).rank, 121);
    EXPECT_NEAR(matrix_figures(basis).condition, 451, 10);
    EXPECT_TRUE(basis.is_estimate);
    EXPECT_FALSE(find_basis("spherical_harmonics:11").ok());
    EXPECT_FALSE(find_basis("spherical_harmonics:x").ok());
}

TEST(Basis, an_unknown_name_lists_the_known_ones) {
    const auto basis = find_basis("s160");
    ASSERT_FALSE(basis.ok());
    EXPECT_NE(basis.error().message.find("single, triangle"), std::string::npos);
}
