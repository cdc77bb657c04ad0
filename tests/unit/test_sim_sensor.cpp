// SPDX-License-Identifier: MIT
// The virtual sensor against its model: generator, noise, lens, mosaic, converter.
// links: ols_stagesim
#include <gtest/gtest.h>

#include <cmath>

#include "render/effects/quantisation.hpp"
#include "render/effects/sensor_noise.hpp"
#include "render/effects/vignetting.hpp"
#include "render/philox.hpp"
#include "render/renderer.hpp"
#include "sim_scenes.hpp"

using namespace ols;

TEST(Philox, gives_the_published_known_answers) {
    // Random123 1.14, tests/kat_vectors, philox4x32 10.
    using Words = std::array<uint32_t, 4>;
    EXPECT_EQ(philox4x32({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
    EXPECT_EQ(philox4x32({~0u, ~0u, ~0u, ~0u}, {~0u, ~0u}), (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
    EXPECT_EQ(philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
              (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

namespace {

Exposure flat_exposure(float counts, uint64_t number = 0) {
    Exposure exposure{Image(400, 300, 1), 0, number};
    std::fill(exposure.counts.data.begin(), exposure.counts.data.end(), counts);
    return exposure;
}

struct Moments {
    double mean = 0, sigma = 0, skew = 0, kurtosis = 0;
};

Moments moments(const std::vector<float>& samples) {
    Moments m;
    for (const float v : samples) m.mean += v / double(samples.size());
    double m2 = 0, m3 = 0, m4 = 0;
    for (const float v : samples) {
        const double d = v - m.mean;
        m2 += d * d, m3 += d * d * d, m4 += d * d * d * d;
    }
    const double n = double(samples.size());
    m.sigma = std::sqrt(m2 / n);
    m.skew = m3 / n / std::pow(m.sigma, 3);
    m.kurtosis = m4 / n / std::pow(m.sigma, 4);
    return m;
}

}  // namespace

TEST(SensorNoise, has_the_mean_and_sigma_of_the_model_and_is_normal) {
    const StageConfig stage = default_stage();
    SensorNoise noise(stage.cameras[0], 1);
    for (const float counts : {0.0f, 10.0f, 250.0f, 2500.0f}) {
        Exposure exposure = flat_exposure(counts);
        noise.apply(exposure);
        const Moments m = moments(exposure.counts.data);
        const double sigma = 2.68 + 0.492 * std::sqrt(double(counts)), n = 120000;
        // Four standard errors of each estimate.
        EXPECT_NEAR(m.mean, counts, 4 * sigma / std::sqrt(n));
        EXPECT_NEAR(m.sigma, sigma, 4 * sigma / std::sqrt(2 * n));
        EXPECT_NEAR(m.skew, 0, 4 * std::sqrt(6 / n));
        EXPECT_NEAR(m.kurtosis, 3, 4 * std::sqrt(24 / n));
    }
}

TEST(SensorNoise, repeats_for_the_same_key_and_is_independent_for_another) {
    const StageConfig stage = default_stage();
    const auto residual = [&](uint64_t seed, uint32_t camera, uint64_t number) {
        Exposure exposure = flat_exposure(100, number);
        exposure.camera = camera;
        SensorNoise(stage.cameras[0], seed).apply(exposure);
        return exposure.counts.data;
    };
    const auto first = residual(1, 0, 5);
    EXPECT_EQ(first, residual(1, 0, 5));
    for (const auto& other :
         {residual(2, 0, 5), residual(1, 1, 5), residual(1, 0, 6), residual(1, 0, 5 + (1ull << 32))}) {
        double product = 0;
        for (size_t i = 0; i < first.size(); ++i) product += (first[i] - 100.0) * (other[i] - 100.0);
        const double sigma = 2.68 + 4.92;
        EXPECT_LT(std::abs(product / double(first.size()) / (sigma * sigma)), 4 / std::sqrt(double(first.size())));
    }
}

TEST(Vignetting, is_one_in_the_middle_and_one_minus_k_in_the_corner) {
    EXPECT_NEAR(Vignetting::factor(0.25f, 320, 240, 641, 481), 1, 1e-6);
    EXPECT_NEAR(Vignetting::factor(0.25f, 0, 0, 6401, 4801), 0.75, 1e-3);
    // Half way to the right edge of a 4:3 picture: r = 0.5 * 0.8.
    EXPECT_NEAR(Vignetting::factor(0.25f, 4800, 2400, 6401, 4801), 1 - 0.25 * 0.16, 1e-3);
}

TEST(Quantisation, adds_black_rounds_to_whole_counts_and_saturates) {
    const StageConfig stage = default_stage();
    Exposure exposure{Image(5, 1, 1), 0, 0};
    exposure.counts.data = {0.4f, 10.6f, -70.0f, 4030.6f, 9000.0f};
    Quantisation(stage.cameras[0]).apply(exposure);
    EXPECT_EQ(exposure.counts.data, (std::vector<float>{64, 75, 0, 4095, 4095}));
}

TEST(Mosaic, keeps_of_every_pixel_the_colour_its_filter_passes) {
    Scene scene;
    Material material = matte(0);
    material.albedo = {0.2f, 0.4f, 0.8f};
    const double colors[] = {0.2, 0.4, 0.8};
    add_quad(scene, {}, {0, 0, 1}, {0, 1, 0}, 2, material);
    StageConfig stage = small_stage({{0, 0, 1}}, 8, 6);
    for (const Cfa cfa : {Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg}) {
        stage.cameras[0].cfa = cfa;
        Renderer renderer({scene, stage, stage.cameras[0], true}, {"falloff", "noise", "quantisation"});
        const Image image = renderer.light(one_lamp(1, 0), 0);
        ASSERT_EQ(image.channels, 1);
        for (int y = 0; y < 6; ++y)
            for (int x = 0; x < 8; ++x) EXPECT_NEAR(image.at(x, y), colors[cfa_color(cfa, x, y)], 1e-6);
    }
}

TEST(Exposures, counts_are_gain_times_time_times_reflectance) {
    Scene scene;
    add_quad(scene, {}, {0, 0, 1}, {0, 1, 0}, 2, matte(0.985f));
    StageConfig stage = small_stage({{0, 0, 1}}, 9, 7);
    stage.cameras[0].vertical_fov_deg = 0.5;
    Renderer renderer({scene, stage, stage.cameras[0], true}, {"noise", "quantisation"});
    // Wenger section 5.1: 412 us under one lamp give a quarter of the scale.
    EXPECT_NEAR(renderer.expose({412}, 0, 0, 0).counts.at(4, 3), 0.985 * 2.52 * 412, 0.5);
}
