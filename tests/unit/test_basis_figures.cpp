// SPDX-License-Identifier: MIT
// The figures of a basis against Wenger's measurements and against closed forms.
// links: ols_stage
#include "stage/basis_figures.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stage/flicker.hpp"

using namespace ols;

namespace {

BasisFigures figures_of(const std::string& name, double exposure_us, const GreyChart& chart = {}) {
    SequenceConfig config;
    config.basis = name;
    config.basis_exposure_us = exposure_us;
    const StageConfig stage = default_stage();
    const auto sequence = compile_sequence(config, stage);
    EXPECT_TRUE(sequence.ok()) << (sequence.ok() ? "" : sequence.error().message);
    return measure_basis(*sequence, stage, stage.cameras[0], chart);
}

double cosine(size_t lamp) {
    return std::max(0.0, default_stage().lamps[lamp].direction.z);
}

double sigma2(double counts) {
    return std::pow(2.68 + 0.492 * std::sqrt(counts), 2);
}

}  // namespace

// Wenger 5.1 to 5.3: 420 lux a lamp, 1250 for three, 6600 for the Hadamard patterns at 412 us and 1600 at 100; a white
// card at a quarter of saturation for one lamp and at three quarters for three.
TEST(BasisFigures, light_and_saturation_are_those_that_wenger_measured) {
    EXPECT_NEAR(figures_of("single", 412).lux_peak, 420, 1);
    EXPECT_NEAR(figures_of("triangle", 412).lux_peak, 1250, 0.03 * 1250);
    EXPECT_NEAR(figures_of("s155", 412).lux_mean, 6600, 0.02 * 6600);
    EXPECT_NEAR(figures_of("s155", 100).lux_mean, 1600, 0.05 * 1600);
    EXPECT_NEAR(figures_of("single", 412).white_share, 0.25, 0.01);
    EXPECT_NEAR(figures_of("triangle", 412).white_share, 0.75, 0.01);
}

TEST(BasisFigures, of_single_lamps_are_the_cameras_own) {
    const BasisFigures figures = figures_of("single", 412);
    for (size_t i = 0; i < 156; ++i) {
        const double counts = 0.24 * cosine(i) * 2.52 * 412;
        EXPECT_NEAR(figures.chart_counts[i], counts, 1e-9);
        EXPECT_NEAR(figures.chart_snr[i], counts / std::sqrt(sigma2(counts)), 1e-9);
        EXPECT_NEAR(figures.shadow_snr[i], 0.01 * counts / std::sqrt(sigma2(0.01 * counts)), 1e-9);
        EXPECT_NEAR(figures.noise_gain[i], 1, 1e-12);
    }
    EXPECT_LT(figures.bias, 1e-12);
    EXPECT_NEAR(figures.lamps_lit_mean, 1, 1e-12);
    double sum = 0;
    int lit = 0;
    for (size_t i = 0; i < 156; ++i)
        if (cosine(i) > 1e-6) sum += figures.chart_snr[i], ++lit;
    EXPECT_NEAR(figures.mean_snr(figures.chart_snr), sum / lit, 1e-9);
}

// With read noise alone an S-matrix gains (n + 1) / (2 sqrt(n)) in SNR over single lamps (Harwit and Sloane 1979).
TEST(BasisFigures, an_s_matrix_gains_as_theory_says_where_noise_is_additive) {
    SequenceConfig config;
    StageConfig stage = default_stage();
    stage.cameras[0].noise.shot = 0;
    config.basis_exposure_us = 50;
    const auto snr = [&](const char* name) {
        config.basis = name;
        return measure_basis(*compile_sequence(config, stage), stage, stage.cameras[0], {}).chart_snr[10];
    };
    EXPECT_NEAR(snr("s155") / snr("single"), 156 / (2 * std::sqrt(155)), 1e-9);
    EXPECT_NEAR(snr("s159") / snr("single"), 160 / (2 * std::sqrt(159)), 1e-9);
}

// Wenger 5.4: regions that are in shadow for one lamp are lit in the rows of the others.
TEST(BasisFigures, multiplexing_loses_in_deep_shadow) {
    const BasisFigures single = figures_of("single", 412), hadamard = figures_of("s155", 61);
    const auto facing = size_t(single.facing_image());
    EXPECT_LT(hadamard.shadow_snr[facing], single.shadow_snr[facing] / 4);
}

TEST(BasisFigures, an_estimate_has_a_bias_and_a_basis_of_full_rank_none) {
    EXPECT_GT(figures_of("spherical_harmonics:3", 30).bias, 0.01);
    EXPECT_LT(figures_of("s159", 50).bias, 1e-9);
    EXPECT_LT(figures_of("triangle", 412).bias, 1e-12);
}

// A lamp that flashes n times at even distances has nothing at the cycle's rate.
TEST(BasisFigures, modulation_at_the_cycles_rate_is_two_for_one_flash_and_none_for_even_ones) {
    SequenceConfig config;
    config.tracking_lamps = {1};
    config.basis = "single";
    Sequence sequence = *compile_sequence(config, default_stage());
    EXPECT_NEAR(measure_flicker(sequence).lamps[0].cycle_modulation, 2, 1e-12);
    for (size_t s = 0; s < sequence.slots.size(); ++s) sequence.slots[s].lit[0] = s % 60 == 7;
    for (Slot& slot : sequence.slots) slot.exposure_ticks = 1000;
    EXPECT_NEAR(measure_flicker(sequence).lamps[0].cycle_modulation, 0, 1e-12);
}
