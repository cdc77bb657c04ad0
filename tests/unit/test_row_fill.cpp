// SPDX-License-Identifier: MIT
// Filled rows against least squares on the rows that are left, written out with Eigen's decompositions, and estimates
// against their bounds.
// links: ols_demultiplex
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "demultiplex/row_fill.hpp"
#include "stage/stage.hpp"

using namespace ols;

namespace {

std::vector<LightPosition> sphere_lamps() {
    return default_stage().lamps;
}

FillModel model_of(const std::string& name) {
    const Basis basis = *find_basis(name, sphere_lamps());
    FillModel model = fill_model(basis);
    add_smooth_prior(model, image_lights(basis, sphere_lamps()));
    return model;
}

Eigen::MatrixXd light_of(const Basis& basis) {
    Eigen::MatrixXd light(basis.rows, basis.images());
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.images(); ++i) light(r, i) = basis.light(r, basis.image_lamps[size_t(i)][0]);
    return light;
}

Eigen::MatrixXd rows_left(const Eigen::MatrixXd& light, const std::vector<int>& masked) {
    std::vector<int> rest;
    for (int r = 0; r < light.rows(); ++r)
        if (std::find(masked.begin(), masked.end(), r) == masked.end()) rest.push_back(r);
    return light(rest, Eigen::all);
}

// Row values with the masked ones put in by the fill, from sums in double.
Eigen::VectorXd filled(const RowFill& fill, Eigen::VectorXd rows) {
    for (const int row : fill.masked) rows(row) = 0;
    Eigen::VectorXd out = rows;
    for (size_t k = 0; k < fill.masked.size(); ++k) {
        double sum = 0;
        for (Eigen::Index r = 0; r < rows.size(); ++r)
            sum += double(fill.weights[k * size_t(rows.size()) + size_t(r)]) * rows(r);
        out(fill.masked[k]) = sum;
    }
    return out;
}

Eigen::VectorXd random_vector(std::mt19937& random, Eigen::Index size, double deviation) {
    std::normal_distribution<double> gauss(0, deviation);
    return Eigen::VectorXd::NullaryExpr(size, [&] { return gauss(random); });
}

// x with |x|_K = norm, along a direction drawn from the prior.
Eigen::VectorXd random_of_norm(std::mt19937& random, const FillModel& model, double norm) {
    const Eigen::LLT<Eigen::MatrixXd> precision(model.precision);
    const Eigen::VectorXd x = precision.matrixU().solve(random_vector(random, model.images(), 1));
    return x * norm / std::sqrt(x.dot(model.precision * x));
}

double squared_norm(const FillModel& model, const Eigen::VectorXd& x) {
    return x.dot(model.precision * x);
}

}  // namespace

TEST(RowFill, a_solvable_set_gives_least_squares_on_the_other_rows) {
    std::mt19937 random(1);
    for (const char* name : {"paley163", "triangle300"}) {
        const Basis basis = *find_basis(name, sphere_lamps());
        const FillModel model = model_of(name);
        const Eigen::MatrixXd light = light_of(basis);
        for (const std::vector<int>& masked : {std::vector<int>{7}, {3, 90}, {0, 40, 80, 120}}) {
            const RowFill fill = row_fill(model, masked, Estimate::none);
            ASSERT_EQ(fill.kind, FillKind::solved);
            const Eigen::VectorXd rows =
                light * random_vector(random, basis.images(), 30) + random_vector(random, basis.rows, 5);
            const Eigen::VectorXd complete = filled(fill, rows);
            const Eigen::VectorXd least_squares =
                rows_left(light, masked).completeOrthogonalDecomposition().solve(rows_left(rows, masked));
            // The pseudo-inverse of the filled rows is least squares on the rest; floats hold a weight to 6e-8.
            const Eigen::VectorXd whole = light.completeOrthogonalDecomposition().solve(complete);
            EXPECT_LT((whole - least_squares).cwiseAbs().maxCoeff(), 1e-3) << name;
        }
    }
}

TEST(RowFill, rows_without_noise_come_back_exactly_from_every_solvable_set_of_s159) {
    std::mt19937 random(2);
    const Basis basis = *find_basis("s159", sphere_lamps());
    const FillModel model = model_of("s159");
    ASSERT_EQ(model.redundancy, 3);
    const Eigen::VectorXd truth = random_vector(random, basis.images(), 30);
    const Eigen::VectorXd rows = light_of(basis) * truth;
    for (int row = 0; row < basis.rows; ++row) {
        const RowFill fill = row_fill(model, {row}, Estimate::none);
        ASSERT_EQ(fill.kind, FillKind::solved);
        ASSERT_LT((model.inverse * filled(fill, rows) - truth).cwiseAbs().maxCoeff(), 1e-3);
    }
}

TEST(RowFill, a_set_is_solved_exactly_when_the_rows_left_have_full_rank) {
    const Basis basis = *find_basis("s159", sphere_lamps());
    const FillModel model = model_of("s159");
    const Eigen::MatrixXd light = light_of(basis);
    std::mt19937 random(3);
    int solved = 0;
    constexpr int sets = 60;
    for (int n = 0; n < sets; ++n) {
        const int lost = 2 + n % 3;  // two, three, and one more than the basis can spare
        std::vector<int> all(159), masked;
        for (int i = 0; i < 159; ++i) all[size_t(i)] = i;
        std::sample(all.begin(), all.end(), std::back_inserter(masked), lost, random);
        const bool full_rank = rows_left(light, masked).colPivHouseholderQr().rank() == basis.images();
        EXPECT_EQ(row_fill(model, masked, Estimate::none).kind, full_rank ? FillKind::solved : FillKind::unsolved);
        solved += full_rank;
    }
    EXPECT_GT(solved, 10);
    EXPECT_LT(solved, sets - 20);
}

TEST(RowFill, a_quarter_of_the_pairs_of_s159_cannot_be_solved) {
    const FillModel model = model_of("s159");
    int unsolved = 0;
    for (int i = 0; i < 159; ++i)
        for (int j = 0; j < i; ++j) {
            // The determinant of the projector's 2 x 2 part.
            const auto& r = model.residual;
            unsolved += r(i, i) * r(j, j) - r(i, j) * r(i, j) < 1e-9;
        }
    EXPECT_EQ(unsolved, 3081);  // of 12561; counted from ranks by another program
}

TEST(RowFill, the_noise_gain_is_that_of_least_squares_on_the_other_rows) {
    for (const char* name : {"paley163", "triangle300"}) {
        const Basis basis = *find_basis(name, sphere_lamps());
        const FillModel model = model_of(name);
        const Eigen::MatrixXd light = light_of(basis);
        const std::vector<int> masked = {5, 60};
        const RowFill fill = row_fill(model, masked, Estimate::none);
        const Eigen::MatrixXd rest = rows_left(light, masked);
        const Eigen::ArrayXd left = (rest.transpose() * rest).inverse().diagonal();
        const Eigen::ArrayXd whole = model.inverse.rowwise().squaredNorm();
        // An S-matrix's recommended inverse is a left inverse, not the pseudo-inverse: 1e-4 more noise.
        EXPECT_NEAR(fill.noise_gain, left.sum() / whole.sum(), 1e-3) << name;
        EXPECT_NEAR(fill.worst_noise_gain, (left / whole).maxCoeff(), 1e-3) << name;
    }
}

TEST(RowFill, hadamard_and_single_lamps_have_no_row_to_spare) {
    for (const char* name : {"hadamard156", "single", "triangle"}) {
        const FillModel model = model_of(name);
        EXPECT_EQ(model.redundancy, 0) << name;
        EXPECT_EQ(row_fill(model, {42}, Estimate::none).kind, FillKind::unsolved) << name;
        EXPECT_EQ(row_fill(model, {42}, Estimate::smooth).kind, FillKind::estimated) << name;
    }
}

TEST(RowFill, an_estimate_of_any_function_of_the_prior_class_is_within_its_bound) {
    std::mt19937 random(4);
    for (const char* name : {"hadamard156", "s159"}) {
        const FillModel model = model_of(name);
        const Eigen::MatrixXd light = light_of(*find_basis(name, sphere_lamps()));
        std::vector<int> highlight;  // every row that lights one lamp
        for (int row = 0; row < model.rows(); ++row)
            if (light(row, 77) > 0) highlight.push_back(row);
        for (const std::vector<int>& masked : {std::vector<int>{10, 42, 111, 120}, {1, 2, 50, 51, 100}, highlight}) {
            const RowFill fill = row_fill(model, masked, Estimate::smooth);
            const Eigen::VectorXd power = power_function(model, masked);
            ASSERT_EQ(fill.kind, FillKind::estimated);
            EXPECT_NEAR(fill.worst_power, power.maxCoeff(), 1e-12);
            for (int n = 0; n < 20; ++n) {
                const Eigen::VectorXd truth = random_of_norm(random, model, 100);
                const Eigen::VectorXd estimate = model.inverse * filled(fill, light * truth);
                const double radius = std::sqrt(std::max(0.0, 100 * 100 - squared_norm(model, estimate)));
                for (Eigen::Index i = 0; i < power.size(); ++i)
                    ASSERT_LE(std::abs(estimate(i) - truth(i)), power(i) * radius + 0.02) << name << " image " << i;
            }
        }
    }
}

TEST(RowFill, the_worst_function_of_the_class_reaches_the_bound) {
    // The adversary hides in what the rows cannot see: x0 = W_M z with the largest value of image i for |x0|_K = B.
    const FillModel model = model_of("hadamard156");
    const Eigen::MatrixXd light = light_of(*find_basis("hadamard156", sphere_lamps()));
    const std::vector<int> masked = {10, 42, 111};
    const RowFill fill = row_fill(model, masked, Estimate::smooth);
    const Eigen::VectorXd power = power_function(model, masked);
    const Eigen::MatrixXd hidden = model.inverse(Eigen::all, masked);
    const Eigen::MatrixXd form = hidden.transpose() * model.precision * hidden;
    for (const Eigen::Index image : {3, 77, 140}) {
        const Eigen::VectorXd z = form.inverse() * hidden.row(image).transpose();
        const Eigen::VectorXd adversary = hidden * z * (100 / std::sqrt(z.dot(form * z)));
        const Eigen::VectorXd estimate = model.inverse * filled(fill, light * adversary);
        EXPECT_NEAR(std::abs(adversary(image) - estimate(image)), 100 * power(image), 0.02 * 100 * power(image));
    }
}

TEST(RowFill, nothing_is_estimated_from_no_rows_at_all) {
    const FillModel model = model_of("s159");
    std::vector<int> all(159);
    for (int i = 0; i < 159; ++i) all[size_t(i)] = i;
    EXPECT_EQ(row_fill(model, all, Estimate::smooth).kind, FillKind::unsolved);
}
