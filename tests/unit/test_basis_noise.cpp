// SPDX-License-Identifier: MIT
// Noise of recovered images against closed forms, and the cameras' presets.
// links: ols_stage
#include <gtest/gtest.h>

#include <cmath>

#include "stage/basis_noise.hpp"
#include "stage/camera_presets.hpp"

using namespace ols;

namespace {

constexpr NoiseModel phantom{2.68, 0.492};

double sigma(double counts) {
    return 2.68 + 0.492 * std::sqrt(counts);
}

double gain_over_single(const std::string& name, double counts) {
    const std::vector<double> lamps(156, counts);
    return sigma(counts) / std::sqrt(image_variances(*find_basis(name), lamps, phantom)[100]);
}

}  // namespace

TEST(BasisNoise, a_single_lamp_has_the_noise_of_its_own_counts) {
    std::vector<double> lamps(156);
    for (size_t i = 0; i < lamps.size(); ++i) lamps[i] = double(i * i);
    const auto variances = image_variances(*find_basis("single"), lamps, phantom);
    for (size_t i = 0; i < lamps.size(); ++i) EXPECT_NEAR(std::sqrt(variances[i]), sigma(lamps[i]), 1e-12);
}

// 159 weights of 1/80 over slots of 80 lamps, of which 3 columns are left out: by design at most 80 and at least 77 lit.
TEST(BasisNoise, s159_averages_its_rows_noise) {
    const std::vector<double> lamps(156, 10.0);
    for (const double variance : image_variances(*find_basis("s159"), lamps, phantom)) {
        EXPECT_LE(variance, 159 / 6400.0 * std::pow(sigma(800), 2));
        EXPECT_GE(variance, 159 / 6400.0 * std::pow(sigma(770), 2));
    }
}

// Standard deviations add, sigma = 2.68 + 0.492 sqrt(mu), and the inversion leaves 4 k / (k + 1)^2 of the variance.
TEST(BasisNoise, hadamard_gains_2_4_at_2_counts_a_lamp_1_6_at_10_and_1_15_at_50) {
    EXPECT_NEAR(gain_over_single("hadamard156", 2), 2.4, 0.05);
    EXPECT_NEAR(gain_over_single("hadamard156", 10), 1.6, 0.05);
    EXPECT_NEAR(gain_over_single("hadamard156", 50), 1.15, 0.05);
}

TEST(BasisNoise, a_lamp_in_shadow_suffers_from_the_other_lamps_only_when_multiplexed) {
    std::vector<double> lamps(156, 50.0);
    lamps[100] = 0;
    EXPECT_NEAR(std::sqrt(image_variances(*find_basis("single"), lamps, phantom)[100]), 2.68, 1e-12);
    EXPECT_GT(std::sqrt(image_variances(*find_basis("hadamard156"), lamps, phantom)[100]), 1.5 * 2.68);
}

TEST(BasisNoise, the_brightest_row_is_the_one_that_saturates_first) {
    const std::vector<double> lamps(156, 3.0);
    EXPECT_EQ(brightest_row_counts(*find_basis("single"), lamps), 3);
    EXPECT_EQ(brightest_row_counts(*find_basis("hadamard156"), lamps), 3 * 156);
}

TEST(CameraPresets, photon_noise_rules_over_98_percent_of_each_cameras_range) {
    for (const auto& preset : camera_presets()) {
        const double equal_counts = std::pow(preset.noise.read_counts / preset.noise.shot, 2);
        EXPECT_LT(equal_counts, 0.02 * ((1 << preset.bits) - 1)) << preset.name;
        EXPECT_GT(equal_counts, 0) << preset.name;
    }
    EXPECT_NEAR(std::pow(2.68 / 0.492, 2) / 4095, 0.0073, 0.0001);  // Wenger section 4: 0.73 %
}

TEST(CameraPresets, an_unknown_name_lists_the_known_ones) {
    const auto preset = find_camera_preset("phantom");
    ASSERT_FALSE(preset.ok());
    EXPECT_NE(preset.error().message.find("phantom_v7.1, canon_d30"), std::string::npos);
}
