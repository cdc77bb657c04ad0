// SPDX-License-Identifier: MIT
// What can be lost of a basis, against least squares on the rows that are left, written out by its normal equations.
// links: ols_stage
#include "stage/row_losses.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <optional>
#include <random>

#include "stage/basis_inverse.hpp"
#include "stage/bursts.hpp"

using namespace ols;

namespace {

Eigen::MatrixXd light_of(const Basis& basis) {
    Eigen::MatrixXd light(basis.rows, basis.images());
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.images(); ++i) light(r, i) = basis.light(r, basis.image_lamps[size_t(i)][0]);
    return light;
}

// The sum of the images' variances from all rows but `lost`; nothing where these do not determine them. A pivot of the normal
// equations of an S-matrix is about 40, or rounding.
std::optional<double> variance_without(const Eigen::MatrixXd& light, const std::vector<int>& lost) {
    Eigen::MatrixXd normal = light.transpose() * light;
    for (const int row : lost) normal -= light.row(row).transpose() * light.row(row);
    const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
    if (factor.vectorD().minCoeff() < 1e-6) return {};
    return factor.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols())).trace();
}

Basis basis_of(int lamps, const std::vector<uint8_t>& levels) {
    Basis basis;
    basis.name = "small";
    basis.lamps = lamps;
    basis.rows = int(levels.size()) / lamps;
    basis.levels = levels;
    return *with_least_squares(std::move(basis));
}

}  // namespace

TEST(RowLosses, a_set_is_made_up_for_where_the_other_rows_have_full_rank_at_the_noise_of_least_squares) {
    std::mt19937 random(1);
    for (const char* name : {"s159", "paley163"}) {
        const Basis basis = *find_basis(name);
        const RowLosses losses(basis);
        const Eigen::MatrixXd light = light_of(basis);
        const double whole = *variance_without(light, {});
        int made_up_for = 0;
        constexpr int sets = 40;
        for (int n = 0; n < sets; ++n) {
            std::vector<int> rows(size_t(basis.rows)), lost;
            std::iota(rows.begin(), rows.end(), 0);
            std::sample(rows.begin(), rows.end(), std::back_inserter(lost), 1 + n % 3, random);
            const auto variance = variance_without(light, lost);
            ASSERT_EQ(losses.makes_up_for(lost), variance.has_value()) << name;
            if (!variance) continue;
            ++made_up_for;
            EXPECT_NEAR(losses.noise_gain(lost), *variance / whole, 1e-6) << name;
        }
        EXPECT_GT(made_up_for, sets / 3);
    }
}

TEST(RowLosses, of_two_rows_of_one_class_the_others_know_nothing_and_of_different_classes_they_do) {
    const Basis basis = *find_basis("s159");
    const auto classes = RowLosses(basis).classes();
    const Eigen::MatrixXd light = light_of(basis);
    std::vector<int> sizes(4);
    for (const int c : classes) {
        ASSERT_TRUE(c >= 0 && c < 4);
        ++sizes[size_t(c)];
    }
    std::sort(sizes.begin(), sizes.end());
    EXPECT_EQ(sizes, (std::vector{39, 40, 40, 40}));
    std::mt19937 random(2);
    for (int n = 0; n < 60; ++n) {
        const int i = int(random() % 159), j = (i + 1 + int(random() % 158)) % 159;
        EXPECT_EQ(variance_without(light, {i, j}).has_value(), classes[size_t(i)] != classes[size_t(j)]);
    }
}

TEST(RowLosses, rows_that_repeat_stand_in_for_each_other_and_for_no_other) {
    // Lamp 0 is lit alone twice; lamps 1 and 2 in three ways, of which two determine both.
    const Basis basis = basis_of(4, {1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1});
    const RowLosses losses(basis);
    EXPECT_EQ(losses.redundancy(), 2);
    EXPECT_EQ(losses.classes(), (std::vector{0, 0, 1, 1, 1, -1}));
    EXPECT_FALSE(losses.makes_up_for(std::array{0, 1}));
    EXPECT_TRUE(losses.makes_up_for(std::array{1, 4}));
    EXPECT_FALSE(losses.makes_up_for(std::array{0, 2, 3}));
    EXPECT_FALSE(losses.makes_up_for(std::array{5}));
}

TEST(RowLosses, what_would_cost_more_than_ten_times_the_noise_is_not_made_up_for) {
    // Without the first row lamp 0 is known from the difference of two rows alone: of one level in 255.
    Basis basis;
    basis.lamps = 2;
    basis.rows = 3;
    basis.level_max = 255;
    basis.levels = {255, 0, 0, 255, 1, 255};
    basis.name = "small";
    const RowLosses losses(*with_least_squares(std::move(basis)));
    EXPECT_GT(losses.noise_gain(std::array{0}), 1e4);
    EXPECT_TRUE(std::isfinite(losses.noise_gain(std::array{0})));
    EXPECT_FALSE(losses.makes_up_for(std::array{0}));
    EXPECT_TRUE(losses.makes_up_for(std::array{1}));
}

TEST(RowLosses, bases_without_a_row_to_spare_have_no_classes) {
    for (const char* name : {"single", "triangle", "hadamard156", "s155", "planes156", "spherical_harmonics:3"}) {
        const Basis basis = *find_basis(name);
        const RowLosses losses(basis);
        EXPECT_EQ(losses.redundancy(), 0) << name;
        EXPECT_EQ(losses.classes(), std::vector<int>(size_t(basis.rows), -1)) << name;
        std::vector<int> order(size_t(basis.rows));
        std::iota(order.begin(), order.end(), 0);
        for (const BurstLoss& burst : measure_bursts(losses, order)) EXPECT_EQ(burst.made_up_for, 0) << name;
    }
}

TEST(Bursts, every_window_is_tried_and_the_cycle_goes_round) {
    const Basis basis = *find_basis("s159");
    const RowLosses losses(basis);
    const Eigen::MatrixXd light = light_of(basis);
    std::vector<int> order(159);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), std::mt19937(3));
    const double whole = *variance_without(light, {});
    for (const BurstLoss& burst : measure_bursts(losses, order)) {
        int made_up_for = 0;
        double worst = 0;
        for (int first = 0; first < 159; ++first) {
            std::vector<int> lost;
            for (int k = 0; k < burst.slots; ++k) lost.push_back(order[size_t((first + k) % 159)]);
            const auto variance = variance_without(light, lost);
            made_up_for += variance.has_value();
            worst = std::max(worst, variance.value_or(0) / whole);
        }
        EXPECT_EQ(burst.windows, 159);
        EXPECT_EQ(burst.made_up_for, made_up_for) << burst.slots;
        EXPECT_NEAR(burst.worst_noise_gain, worst, 1e-6) << burst.slots;
    }
}
