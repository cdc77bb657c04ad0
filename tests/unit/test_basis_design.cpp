// SPDX-License-Identifier: MIT
// Designed bases: against known optima, finite differences, simulated noise, and bounds that nothing may pass.
// links: ols_stage Eigen3::Eigen
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "stage/basis_file.hpp"
#include "stage/basis_noise.hpp"
#include "stage/design_search.hpp"
#include "stage/design_starts.hpp"

using namespace ols;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// As many lamps as the smaller problems need, spread over the sphere.
std::vector<LightPosition> some_lamps(int count) {
    auto lamps = named_lamps();
    std::vector<LightPosition> some;
    for (int i = 0; i < count; ++i) some.push_back(lamps[size_t(i) * lamps.size() / size_t(count)]);
    return some;
}

DesignProblem cosine_problem(int lamps, int rows, double counts) {
    DesignProblem problem;
    problem.subjects = cosine_subjects(some_lamps(lamps), counts, 16);
    problem.rows = rows;
    return problem;
}

DesignProblem additive_problem(int lamps) {
    DesignProblem problem;
    problem.subjects = equal_subject(lamps, 100);
    problem.noise = {1, 0};
    problem.rows = lamps;
    return problem;
}

Light random_grey(int rows, int lamps, uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> level(0.05, 0.95);
    Light light(rows, lamps);
    for (Index at = 0; at < light.size(); ++at) light(at) = level(random);
    return light;
}

Design designed(const DesignProblem& problem, const DesignOptions& options = {}) {
    const auto design = design_basis(problem, options, nullptr);
    EXPECT_TRUE(design.ok()) << design.error().message;
    return *design;
}

}  // namespace

TEST(DesignProblem, the_gradient_is_that_of_finite_differences) {
    DesignProblem problem = cosine_problem(9, 11, 40);
    problem.worst = 0.5;
    const Light light = random_grey(11, 9, 1);
    const Light gradient = design_gradient(problem, light, design_cost(problem, light));
    constexpr double step = 1e-5;
    for (Index at = 0; at < light.size(); ++at) {
        Light more = light, less = light;
        more(at) += step;
        less(at) -= step;
        const double slope = (design_cost(problem, more).cost - design_cost(problem, less).cost) / (2 * step);
        EXPECT_NEAR(gradient(at), slope, 1e-5 * gradient.cwiseAbs().maxCoeff()) << "level " << at;
    }
}

TEST(DesignProblem, a_light_that_cannot_tell_two_lamps_apart_costs_infinitely_much) {
    Light light = Light::Identity(9, 9);
    light.col(3) = light.col(4);
    EXPECT_TRUE(std::isinf(design_cost(cosine_problem(9, 9, 40), light).cost));
}

// The variational inequality: p is the point of a convex set nearest to y when (y - p)'(q - p) <= 0 for all its q.
TEST(DesignProblem, the_nearest_feasible_light_is_feasible_and_none_is_nearer) {
    DesignProblem problem = cosine_problem(12, 4, 100);
    problem.cards = problem.subjects;
    problem.white_counts = 150;
    problem.brightness_max = 3;
    problem.duty_max = 1;
    const Light far = 3 * random_grey(4, 12, 2);
    ASSERT_FALSE(is_feasible(problem, far));
    const Light near = nearest_feasible(problem, far);
    EXPECT_TRUE(is_feasible(problem, near));
    for (uint64_t seed = 10; seed < 60; ++seed) {
        const Light raw = random_grey(4, 12, seed);
        const Light other = exposure_share(problem, raw) * raw;
        for (Index r = 0; r < 4; ++r) {
            const VectorXd away = far.row(r) - near.row(r), along = other.row(r) - near.row(r);
            EXPECT_LE(away.dot(along), 1e-3 * away.norm() * along.norm());
        }
    }
}

// Additive noise: the S-matrix is optimal and leaves 4 n / (n + 1)^2 (Harwit and Sloane 1979).
TEST(DesignSearch, exchange_repairs_an_s_matrix_in_which_a_twentieth_of_the_levels_is_wrong) {
    const DesignProblem problem = additive_problem(11);
    Light start;
    for (const auto& design : block_designs(11))
        if (design.name == "Paley 11") start = design.light;
    for (const auto& [row, lamp] : {std::pair(0, 3), {2, 2}, {5, 9}, {6, 0}, {9, 7}, {10, 10}})
        start(row, lamp) = 1 - start(row, lamp);
    const double optimum = 4 * 11 / 144.0;
    ASSERT_GT(design_cost(problem, start).cost, 1.3 * optimum);
    EXPECT_NEAR(design_cost(problem, exchange(problem, start, 1, 100)).cost, optimum, 1e-9);
}

TEST(DesignSearch, descent_over_grey_levels_finds_the_s_matrix_for_additive_noise) {
    const DesignProblem problem = additive_problem(7);
    double best = 1e9;
    for (uint64_t seed = 0; seed < 20; ++seed)
        best = std::min(best, design_cost(problem, descend(problem, random_grey(7, 7, seed), 1000)).cost);
    EXPECT_NEAR(best, 4 * 7 / 64.0, 0.01 * 4 * 7 / 64.0);
}

TEST(DesignSearch, eleven_lamps_with_additive_noise_reach_the_s_matrix) {
    EXPECT_NEAR(designed(additive_problem(11)).cost, 4 * 11 / 144.0, 0.01 * 4 * 11 / 144.0);
}

TEST(DesignSearch, exchange_keeps_an_account_of_the_cost_that_is_true_and_never_makes_it_worse) {
    for (const int level_max : {1, 255}) {
        DesignProblem problem = cosine_problem(20, 23, 30);
        problem.worst = level_max == 255 ? 0.5 : 0;
        problem.cards = 5 * problem.subjects;
        problem.white_counts = 700;
        for (const auto& start : design_starts(problem, level_max == 255, 1)) {
            const double before = design_cost(problem, start.light).cost;
            if (std::isinf(before)) continue;
            const Light after = exchange(problem, start.light, level_max, 5);
            EXPECT_LE(design_cost(problem, after).cost, before * (1 + 1e-9)) << start.name;
            EXPECT_TRUE(is_feasible(problem, after)) << start.name;
            EXPECT_LT(((after * level_max).array() - (after * level_max).array().round()).abs().maxCoeff(), 1e-9);
        }
    }
}

TEST(DesignSearch, with_so_much_light_that_nothing_helps_it_falls_back_to_single_lamps_or_better) {
    const DesignProblem problem = cosine_problem(20, 20, 1e7);
    EXPECT_LE(designed(problem).cost, single_cost(problem) * (1 + 1e-12));
}

TEST(DesignSearch, grey_levels_stay_within_limits_and_the_file_read_back_has_the_noise_that_was_promised) {
    DesignProblem problem = cosine_problem(24, 26, 60);
    problem.cards = 4 * problem.subjects;
    problem.white_counts = 900;
    problem.brightness_max = 7;
    DesignOptions options;
    options.grey = true;
    const Design design = designed(problem, options);
    EXPECT_TRUE(is_feasible(problem, design.light));
    EXPECT_GE(design.light.minCoeff(), 0);
    EXPECT_LE(design.light.maxCoeff(), 1);

    const auto path = std::filesystem::temp_directory_path() / fmt::format("designed{}.csv", getpid());
    ASSERT_TRUE(write_basis(path, *basis_of(design, "designed")).ok());
    const auto basis = read_basis(path, 24);
    std::filesystem::remove(path);
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    double mean = 0;
    for (Index k = 0; k < problem.subjects.rows(); ++k) {
        const VectorXd lamps = problem.subjects.row(k);
        for (const double variance : image_variances(*basis, {lamps.data(), size_t(lamps.size())}, problem.noise))
            mean += variance / double(problem.subjects.size());
    }
    EXPECT_GE(mean, design.cost * (1 - 1e-9));  // weights would be better yet
    EXPECT_LE(mean, design.cost * 1.05);
}

TEST(DesignSearch, the_same_options_find_the_same_basis) {
    const DesignProblem problem = cosine_problem(20, 22, 30);
    EXPECT_EQ(designed(problem).light, designed(problem).light);
}

TEST(DesignSearch, fewer_rows_than_lamps_are_refused) {
    const auto design = design_basis(cosine_problem(20, 19, 30), {}, nullptr);
    ASSERT_FALSE(design.ok());
    EXPECT_NE(design.error().message.find("19 rows cannot tell 20 lamps apart"), std::string::npos);
}

TEST(DesignSearch, limits_that_no_basis_keeps_are_refused) {
    DesignProblem problem = cosine_problem(20, 20, 30);
    problem.brightness_max = 0.5;
    EXPECT_FALSE(design_basis(problem, {}, nullptr).ok());
}

// Seeded Gaussian noise of the camera's sigma on every row of one subject, inverted as the basis says.
TEST(DesignSearch, simulated_noise_is_within_3_percent_of_the_prediction) {
    DesignProblem problem = cosine_problem(156, 159, 50);
    DesignOptions options;
    options.starts = 1;
    options.exchange_sweeps = 0;
    const auto basis = basis_of(designed(problem, options), "designed");
    ASSERT_TRUE(basis.ok());
    const VectorXd lamps = problem.subjects.row(5);
    const auto predicted = image_variances(*basis, {lamps.data(), size_t(lamps.size())}, problem.noise);

    MatrixXd inverse(basis->images(), basis->rows), light = light_of(*basis);
    for (int r = 0; r < basis->rows; ++r)
        for (int i = 0; i < basis->images(); ++i) inverse(i, r) = basis->inverse(r, i);
    const VectorXd clean = light * lamps;
    constexpr int samples = 1500;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    MatrixXd frames(basis->rows, samples);
    for (Index s = 0; s < samples; ++s)
        for (Index r = 0; r < clean.size(); ++r)
            frames(r, s) = clean(r) + (2.68 + 0.492 * std::sqrt(clean(r))) * normal(random);
    const MatrixXd errors = (inverse * frames).colwise() - lamps;
    double mean_predicted = 0;
    for (const double variance : predicted) mean_predicted += variance / double(predicted.size());
    EXPECT_NEAR(errors.array().square().mean() / mean_predicted, 1, 0.03);
    EXPECT_LT(errors.rowwise().mean().cwiseAbs().maxCoeff(), 6 * std::sqrt(mean_predicted / samples));
}
