// SPDX-License-Identifier: MIT
// The lower bound on noise, the block designs that reach it, and bases that must stay above it.
// links: ols_stage Eigen3::Eigen
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "stage/design_starts.hpp"
#include "stage/noise_bound.hpp"

using namespace ols;
using Eigen::Index;
using Eigen::MatrixXd;

namespace {

constexpr NoiseModel phantom{2.68, 0.492};

double mean_variance(const Light& light, double counts, const NoiseModel& noise) {
    DesignProblem problem;
    problem.subjects = equal_subject(int(light.cols()), counts);
    problem.noise = noise;
    problem.rows = int(light.rows());
    return design_cost(problem, light).cost;
}

}  // namespace

TEST(BlockDesigns, light_the_same_number_of_lamps_in_every_row_and_share_the_same_number_in_any_two) {
    const auto designs = block_designs(183);
    EXPECT_GT(designs.size(), 20u);
    for (const auto& design : designs) {
        const MatrixXd shared = design.light * design.light.transpose();
        const double common = double(design.k) * (design.k - 1) / (design.v - 1);
        EXPECT_EQ(common, std::round(common)) << design.name;
        const Index v = design.v;
        const MatrixXd ideal = common * MatrixXd::Ones(v, v) + (design.k - common) * MatrixXd::Identity(v, v);
        EXPECT_EQ(shared, ideal) << design.name;
    }
}

TEST(BlockDesigns, have_a_projective_space_of_just_156_points) {
    for (const auto& design : block_designs(156))
        if (design.name == "PG(3, 5)") {
            EXPECT_EQ(design.v, 156);
            EXPECT_EQ(design.k, 31);
            return;
        }
    FAIL();
}

TEST(NoiseBound, is_reached_by_every_symmetric_block_design_for_its_number_of_lit_lamps) {
    for (const auto& design : block_designs(60)) {
        const BoundProblem problem{design.v, design.v, 20, phantom};
        EXPECT_NEAR(noise_bound_at(problem, design.k), mean_variance(design.light, 20, phantom), 1e-9) << design.name;
    }
}

TEST(NoiseBound, is_not_passed_by_any_light_of_any_levels_at_any_counts) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> level(0, 1);
    for (const double counts : {0.1, 3.0, 100.0, 1e5})
        for (int trial = 0; trial < 200; ++trial) {
            const int lamps = 3 + int(random() % 10), rows = lamps + int(random() % 4);
            const double share = level(random);
            Light light(rows, lamps);
            for (Index at = 0; at < light.size(); ++at)
                light(at) = level(random) < share ? 1 : trial % 2 ? level(random) * level(random) : 0;
            const NoiseModel noise{trial % 3 * 1.5, trial % 5 * 0.3 + 0.01};
            EXPECT_GE(mean_variance(light, counts, noise),
                      noise_bound({lamps, rows, counts, noise}).mean_variance * (1 - 1e-9));
        }
}

// Photon noise alone: F has trace at most rows / (shot^2 counts), so tr F^-1 >= n^2 shot^2 counts / rows.
TEST(NoiseBound, says_that_nothing_beats_single_lamps_under_photon_noise_alone) {
    const NoiseModel photon{0, 0.5};
    const double single = 0.25 * 80;
    EXPECT_GT(noise_bound({156, 156, 80, photon}).mean_variance, single * 0.98);
    EXPECT_LE(noise_bound({156, 156, 80, photon}).mean_variance, single);
}

TEST(NoiseBound, of_additive_noise_is_that_of_the_s_matrix) {
    const NoiseModel additive{1, 0};
    EXPECT_NEAR(noise_bound({159, 159, 10, additive}).mean_variance, 4 * 159 / 25600.0, 2e-4 * 4 * 159 / 25600.0);
}

TEST(NoiseBound, a_limit_on_brightness_raises_it) {
    const NoiseBound free = noise_bound({156, 159, 10, phantom}), dim = noise_bound({156, 159, 10, phantom, 5});
    EXPECT_LE(dim.lit, 5);
    EXPECT_GT(dim.mean_variance, 1.5 * free.mean_variance);
}
