// SPDX-License-Identifier: MIT
// Random on/off patterns: "any linearly independent set of patterns" (Wenger 5) can be inverted, but their condition
// number is in the thousands, and what comes back is noise.
// links: ols_stage Eigen3::Eigen
#include <Eigen/Dense>
#include <filesystem>
#include <random>

#include "hard_case.hpp"
#include "stage/basis_file.hpp"
#include "stage/basis_inverse.hpp"

using namespace ols;

namespace {

constexpr int n = sphere_lamp_count;

Basis random_levels(unsigned seed) {
    std::mt19937 random(seed);
    Basis basis;
    basis.name = "random";
    basis.rows = basis.lamps = n;
    for (int k = 0; k < n * n; ++k) basis.levels.push_back(uint8_t(random() >> 31));
    return basis;
}

template <typename Matrix>
Matrix light_of(const Basis& basis) {
    Matrix light(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) light(r, i) = typename Matrix::Scalar(basis.light(r, i));
    return light;
}

double condition_of(const Basis& basis) {
    const Eigen::VectorXd s = Eigen::BDCSVD<Eigen::MatrixXd>(light_of<Eigen::MatrixXd>(basis)).singularValues();
    return s(0) / s(n - 1);
}

// The first random basis whose condition number is between the two.
Basis levels_of_condition(double least, double most) {
    for (unsigned seed = 1;; ++seed) {
        Basis basis = random_levels(seed);
        const double condition = condition_of(basis);
        if (condition > least && condition < most) return basis;
    }
}

Eigen::VectorXd random_lamps() {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> value(50, 150);
    Eigen::VectorXd lamps(n);
    for (double& lamp : lamps) lamp = value(random);
    return lamps;
}

}  // namespace

// The noise that is foretold is the noise that comes. Bound: the variance of one lamp over N samples of normal noise has
// a relative standard deviation of sqrt(2 / N); the mean over lamps has at most that, and five of them are not exceeded.
TEST(RandomBasis, predicted_noise_is_the_noise_of_a_simulation) {
    const auto basis = with_least_squares(levels_of_condition(2e3, condition_max));
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    Eigen::MatrixXd inverse(n, n);
    double predicted = 0;
    for (int i = 0; i < n; ++i) {
        predicted += noise_variance(*basis, i) / n;
        for (int r = 0; r < n; ++r) inverse(i, r) = basis->inverse(r, i);
    }
    constexpr int samples = 4096;
    std::mt19937 random(6);
    std::normal_distribution<double> count(0, 1);
    Eigen::MatrixXd noise(n, samples);
    for (double& sample : noise.reshaped()) sample = count(random);
    const double simulated = (inverse * noise).squaredNorm() / (n * samples);
    // Naive: rows have unit noise, so lamps have it, too.
    expect_within("random on/off patterns: foretold noise variance against a simulation",
                  std::abs(1 / simulated - 1) * 100, std::abs(predicted / simulated - 1) * 100,
                  5 * std::sqrt(2.0 / samples) * 100, "%");
}

// Bound: an inverse in double is wrong by at most a few n eps cond (Higham, "Accuracy and Stability of Numerical
// Algorithms", 2nd ed., 14.1 and 14.3): 4 n 2^-53 cond |x| in the norm.
TEST(RandomBasis, inverse_in_double_keeps_the_bound_where_float_loses_it) {
    const Basis levels = levels_of_condition(2e3, condition_max);
    const Eigen::VectorXd lamps = random_lamps();
    const Eigen::VectorXd rows = light_of<Eigen::MatrixXd>(levels) * lamps;
    const Eigen::VectorXf by_gauss = light_of<Eigen::MatrixXf>(levels).partialPivLu().solve(rows.cast<float>());
    const auto basis = with_least_squares(levels);
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    double ours = 0;
    for (int i = 0; i < n; ++i) {
        double image = 0;
        for (int r = 0; r < n; ++r) image += basis->inverse(r, i) * rows(r);
        ours = std::max(ours, std::abs(image - lamps(i)));
    }
    expect_within("random on/off patterns without noise, float Gauss (naive) or our inverse",
                  (by_gauss.cast<double>() - lamps).cwiseAbs().maxCoeff(), ours,
                  4 * n * 0x1p-53 * condition_of(levels) * lamps.norm(), "counts");
}

// Beyond condition_max the file is refused, with advice. Bound: the error of half a count of rounding, the least that
// a camera does, can reach cond / |A| half counts, which says why.
TEST(RandomBasis, near_singular_file_is_refused) {
    const Basis levels = levels_of_condition(condition_max, 1e9);
    const auto path = std::filesystem::temp_directory_path() / "stability_random_basis.csv";
    ASSERT_TRUE(write_basis(path, levels).ok());
    const auto basis = read_basis(path, n);
    std::filesystem::remove(path);
    ASSERT_FALSE(basis.ok());
    EXPECT_NE(basis.error().message.find("near-singular"), std::string::npos) << basis.error().message;
    EXPECT_NE(basis.error().message.find("remove rows that nearly repeat others"), std::string::npos);

    const Eigen::MatrixXf light = light_of<Eigen::MatrixXf>(levels);
    const Eigen::VectorXd lamps = random_lamps();
    const Eigen::VectorXf rows = (light.cast<double>() * lamps).array().round().matrix().cast<float>();
    const Eigen::VectorXf naive = (light.transpose() * light).partialPivLu().solve(light.transpose() * rows);
    const double error = (naive.cast<double>() - lamps).cwiseAbs().maxCoeff();
    EXPECT_GT(error, lamps.maxCoeff()) << "larger than the lamps themselves";
    record_case("near-singular basis file, float normal equations on lamps of 100 counts", with_unit(error, "counts"),
                "refused, with advice", "condition number at most " + with_unit(condition_max, ""));
}
