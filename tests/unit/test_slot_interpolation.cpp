// SPDX-License-Identifier: MIT
// Slots between their frames before and after the target: the blend's closed form, its noise, and what must not change.
// links: ols_develop
#include "develop/slot_interpolation.hpp"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <random>

#include "demultiplex/masked_sample.hpp"

using namespace ols;

namespace {

constexpr size_t padding = 16;

template <typename Sum>
struct Blended {
    Sum sample;
    float noise;
};

template <typename Sum>
Blended<Sum> blended(Sum nearer, Sum across, float share, float trust_across) {
    std::vector<Sum> samples(padding, nearer), others(padding, across);
    std::vector<float> trust(padding, trust_across), noise(padding);
    blend_across<Sum>({{samples.data(), 1}, others.data(), trust.data(), share, noise.data(), 1});
    return {samples[0], noise[0]};
}

constexpr int width = 32, height = 4;

MotionKnot knot(double tick, float shift, float confidence, bool is_instant = false) {
    MotionKnot made{tick, FlowField(width, height), std::vector<float>(width * height, confidence), is_instant};
    std::ranges::fill(made.flow.u, shift);
    return made;
}

Alignment alignment_of(const MotionPath& path) {
    return Alignment(path, width, height, Cfa::none, GroupMotion::default_tolerance, 1);
}

}  // namespace

TEST(SlotInterpolation, is_linear_in_time_where_both_are_trusted) {
    EXPECT_EQ(blended<int16_t>(100, 200, 0.75f, 1).sample, 125);
    EXPECT_EQ(blended<int32_t>(-100, -201, 0.5f, 1).sample, -151) << "half away from zero";
    EXPECT_FLOAT_EQ(blended<float>(1, 2, 0.9f, 1).sample, 1.1f);
}

TEST(SlotInterpolation, leans_to_the_one_that_is_trusted) {
    // w / (1 - w) = 4 * 1 / 4.
    EXPECT_EQ(blended<int16_t>(100, 200, 0.8f, 4).sample, 150);
    EXPECT_NEAR(blended<float>(100, 200, 0.8f, 900).sample, 100 + 100 * 180 / 180.8, 1e-3);
    EXPECT_NEAR(blended<float>(100, 200, 0.5f, 1 / 900.0f).sample, 100, 0.12);
}

TEST(SlotInterpolation, leaves_what_does_not_move_and_what_is_masked) {
    constexpr int16_t masked = masked_sample<int16_t>;
    EXPECT_EQ(blended<int16_t>(100, 200, 0.5f, 0).sample, 100);
    EXPECT_EQ(blended<int16_t>(masked, 200, 0.5f, 1).sample, masked);
    EXPECT_EQ(blended<int16_t>(100, masked, 0.5f, 1).sample, 100);
    EXPECT_EQ(blended<int16_t>(100, masked, 0.5f, 1).noise, 0);
    EXPECT_TRUE(std::isnan(blended<float>(masked_sample<float>, 2, 0.5f, 1).sample));
    EXPECT_EQ(blended<float>(1, masked_sample<float>, 0.5f, 1).sample, 1);
}

TEST(SlotInterpolation, tells_the_noise_that_is_left) {
    std::mt19937 random(3);
    std::normal_distribution<float> normal;
    for (const float share : {0.5f, 0.7f, 1.0f}) {
        double squares = 0;
        constexpr int count = 20000;
        for (int i = 0; i < count; ++i)
            squares += std::pow(blended(normal(random), normal(random), share, 1).sample, 2);
        EXPECT_NEAR(squares / count, 1 + blended(0.0f, 0.0f, share, 1).noise, 0.03) << share;
    }
}

TEST(SlotInterpolation, gives_the_same_bits_on_every_path_and_leaves_its_neighbours) {
    constexpr size_t samples = 208;
    std::mt19937 random(8);
    std::vector<int16_t> nearer(samples), across(samples);
    std::vector<float> trust(samples);
    for (size_t p = 0; p < samples; ++p) {
        nearer[p] = p % 19 == 0 ? masked_sample<int16_t> : int16_t(random() % 4200 - 100);
        across[p] = p % 23 == 0 ? masked_sample<int16_t> : int16_t(random() % 4200 - 100);
        trust[p] = p % 7 == 0 ? 0 : float(random() % 1000) / 300;
    }
    std::vector<std::vector<int16_t>> results;
    std::vector<std::vector<float>> noises;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        results.push_back(nearer);
        noises.emplace_back(samples);
        blend_across<int16_t>({results.back(), across.data(), trust.data(), 0.7f, noises.back().data(), 0.5f});
    }
    hwy::SetSupportedTargetsForTest(0);
    ASSERT_GT(results.size(), 1u);
    for (const auto& result : results) EXPECT_EQ(result, results[0]);
    for (const auto& noise : noises) EXPECT_EQ(noise, noises[0]);
    for (size_t p = 0; p < samples; ++p)
        EXPECT_EQ(results[0][p], blended(nearer[p], across[p], 0.7f, trust[p]).sample) << p;
}

// The target in the middle of three knots; what goes on before it is hidden.
TEST(SlotInterpolation, trusts_the_frame_across_as_much_as_the_nearer_one_at_most) {
    const Alignment alignment = alignment_of({knot(0, -3, 0.1f), knot(1000, 0, 1, true), knot(2000, 3, 0.9f)});
    const std::vector<float> seen = trust_across(alignment, 0, 1), hidden = trust_across(alignment, 1, 0);
    for (size_t p = 0; p < size_t(width * height); ++p) {
        EXPECT_EQ(seen[p], 1);
        EXPECT_FLOAT_EQ(hidden[p], 1 / 81.0f);
    }
}

TEST(SlotInterpolation, takes_what_does_not_move_from_the_nearer_frame_alone) {
    const Alignment alignment = alignment_of({knot(0, 0, 0.3f), knot(1000, 0, 1, true), knot(2000, 0, 0.9f)});
    for (const float trust : trust_across(alignment, 0, 1)) EXPECT_EQ(trust, 0);
    for (const uint8_t moves : alignment.moves()) EXPECT_EQ(moves, 0);
}

// What breaks it: something that is there in one of the two frames only. It is seen, fainter, and never more than both.
TEST(SlotInterpolation, shows_what_only_one_frame_has_by_its_share) {
    EXPECT_FLOAT_EQ(blended<float>(100, 1000, 0.9f, 1).sample, 190);
    EXPECT_FLOAT_EQ(blended<float>(1000, 100, 0.9f, 1).sample, 910);
}
