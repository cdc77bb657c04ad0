// SPDX-License-Identifier: MIT
// Wenger's triangles (5.2) have rank 152 for 156 lamps: no inversion gives single lamps, and one that does not look
// returns noise.
// links: ols_stage Eigen3::Eigen
#include <Eigen/Dense>
#include <random>

#include "hard_case.hpp"
#include "stage/basis_inverse.hpp"
#include "stage/triangles.hpp"

using namespace ols;

namespace {

Basis north_triangle_levels() {
    const auto triangles = north_triangles(stage_lamp_directions());
    Basis basis;
    basis.name = "north triangles";
    basis.rows = int(triangles.size()), basis.lamps = sphere_lamp_count;
    basis.levels.resize(triangles.size() * size_t(basis.lamps));
    for (size_t r = 0; r < triangles.size(); ++r)
        for (const int lamp : triangles[r]) basis.levels[r * size_t(basis.lamps) + size_t(lamp)] = 1;
    return basis;
}

Eigen::MatrixXd light_of(const Basis& basis) {
    Eigen::MatrixXd light(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) light(r, i) = basis.light(r, i);
    return light;
}

// A pixel's reflectance function in counts, and its rows with one count of noise.
struct Pixel {
    Eigen::VectorXd lamps, noise, rows;
};

Pixel noisy_pixel(const Eigen::MatrixXd& light) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> value(50, 150);
    std::normal_distribution<double> count(0, 1);
    Pixel pixel{Eigen::VectorXd(light.cols()), Eigen::VectorXd(light.rows()), {}};
    for (double& lamp : pixel.lamps) lamp = value(random);
    for (double& sample : pixel.noise) sample = count(random);
    pixel.rows = light * pixel.lamps + pixel.noise;
    return pixel;
}

Eigen::VectorXd recovered(const Basis& basis, const Eigen::VectorXd& rows) {
    Eigen::VectorXd images = Eigen::VectorXd::Zero(basis.images());
    for (int i = 0; i < basis.images(); ++i)
        for (int r = 0; r < basis.rows; ++r) images(i) += basis.inverse(r, i) * rows(r);
    return images;
}

double largest(const Eigen::VectorXd& v) {
    return v.cwiseAbs().maxCoeff();
}

// The matrix that would be applied to every pixel, from the normal equations, without a look at the pivots.
Eigen::VectorXd by_normal_equations(const Eigen::MatrixXd& light, const Eigen::VectorXd& rows) {
    const Eigen::MatrixXd normal = light.transpose() * light;
    return normal.inverse() * (light.transpose() * rows);
}

}  // namespace

// Bound, lamp by lamp: the shortest solution is V V' (x + A+ noise), V the right singular vectors that count. It lacks the
// part of x in the null space and adds at most |row i of A+| |noise|: |x - V V' x|_i + |A+_i| |noise|. Here both follow from
// Eigen's Jacobi decomposition of the levels, not from the inverse under test. The smallest singular value that counts is
// 0.0011, so that one count of noise may become hundreds: an estimate, and marked as one.
TEST(RankDeficientTriangles, shortest_estimate_is_marked_and_keeps_its_bias_bound) {
    const Basis levels = north_triangle_levels();
    const Eigen::MatrixXd light = light_of(levels);
    const Pixel pixel = noisy_pixel(light);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(light, Eigen::ComputeThinU | Eigen::ComputeThinV);
    constexpr int rank = 152;
    ASSERT_LT(svd.singularValues()(rank), 1e-9);
    ASSERT_GT(svd.singularValues()(rank - 1), 1e-3);
    const Eigen::MatrixXd v = svd.matrixV().leftCols(rank);
    const Eigen::VectorXd bias = pixel.lamps - v * (v.transpose() * pixel.lamps);
    const Eigen::VectorXd gain = (v * svd.singularValues().head(rank).cwiseInverse().asDiagonal()).rowwise().norm();
    const Eigen::VectorXd bound = bias.cwiseAbs() + gain * pixel.noise.norm();

    const auto basis = with_least_squares(levels);
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    EXPECT_TRUE(basis->is_estimate);
    const Eigen::VectorXd error = (recovered(*basis, pixel.rows) - pixel.lamps).cwiseAbs();
    EXPECT_TRUE((error.array() <= bound.array()).all());
    expect_within("triangles of rank 152 inverted to 156 lamps",
                  largest(by_normal_equations(light, pixel.rows) - pixel.lamps), largest(error), largest(bound),
                  "counts");
}

// Bound: an image is its row over three, so that its error is the row's noise over three.
TEST(RankDeficientTriangles, each_triangle_as_one_light_needs_no_inversion) {
    const Eigen::MatrixXd light = light_of(north_triangle_levels());
    const Pixel pixel = noisy_pixel(light);
    const Basis basis = *find_basis("triangle");
    ASSERT_EQ(basis.images(), 155);
    Eigen::VectorXd truth = Eigen::VectorXd::Zero(basis.images());
    for (int i = 0; i < basis.images(); ++i)
        for (const int lamp : basis.image_lamps[size_t(i)]) truth(i) += pixel.lamps(lamp) / 3;
    expect_within("triangles as Wenger uses them, one light each",
                  largest(by_normal_equations(light, pixel.rows) - pixel.lamps),
                  largest(recovered(basis, pixel.rows) - truth), largest(pixel.noise) / 3 * (1 + 1e-12), "counts");
}
