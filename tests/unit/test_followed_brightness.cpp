// SPDX-License-Identifier: MIT
// Samples that follow the brightness of the tracking frames: the factor's closed form, and what must not move.
// links: ols_develop
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <random>

#include "demultiplex/masked_sample.hpp"
#include "develop/followed_brightness.hpp"

using namespace ols;

namespace {

const NoiseModel noise, quiet = {.read_counts = 0, .shot = 0};

const BrightnessKnots even_knots = {.ticks = {0, 1, 2}, .light = {1, 1, 1}, .instant = 1};

// Bands of one sample.
template <typename Sum>
RowBand<Sum> band_of(std::initializer_list<Sum> rows) {
    RowBand<Sum> band(rows.size(), 1);
    size_t row = 0;
    for (const Sum sample : rows) band.row(row++)[0] = sample;
    return band;
}

// Three knots at 0, 1 and 2, the target's in the middle.
template <typename Sum>
Sum followed(Sum before, Sum now, Sum after, double tick, Sum sample, const NoiseModel& camera = quiet,
             bool is_moving = true) {
    const uint8_t moves = is_moving;
    const FollowedBrightness<Sum> brightness(band_of<Sum>({before, now, after}), even_knots, camera, {&moves, 1});
    RowBand<Sum> samples = band_of<Sum>({sample});
    brightness.apply(tick, samples.row(0));
    return samples.row(0)[0];
}

}  // namespace

TEST(FollowedBrightness, multiplies_by_the_quotient_of_the_target_and_the_slots_own_time) {
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, 0, 300), 600);
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, 0.25, 300), 480) << "625 counts a quarter of the way";
    EXPECT_EQ(followed<int32_t>(1000, 1000, 2000, 1.5, -300), -200);
    EXPECT_FLOAT_EQ(followed<float>(1000, 1000, 2000, 2, 3.5f), 1.75f);
}

TEST(FollowedBrightness, leaves_to_the_bit_what_changes_less_than_noise_may) {
    const double sigma = noise.read_counts + noise.shot * std::sqrt(1000.0);
    for (const auto& [is_moving, deviations] : {std::pair(true, 1.5f), std::pair(false, 6.0f)}) {
        const auto least = float(deviations * std::sqrt(2.0) * sigma);
        const auto after = [&, moves = is_moving](float change) {
            return followed<float>(1000, 1000, 1000 + change * least, 2, 123.25f, noise, moves);
        };
        EXPECT_EQ(after(0.99f), 123.25f);
        EXPECT_NE(after(1.01f), 123.25f);
    }
    EXPECT_EQ(followed<float>(2000, 1000, 1000, 1.5, 123.25f, noise), 123.25f) << "another interval's change";
}

// d = 60 of 1000 counts: of the quotient's way from 1 it goes 1 - (n / d)^2.
TEST(FollowedBrightness, goes_the_farther_the_surer_it_is) {
    const double n = 1.5 * std::sqrt(2.0) * (noise.read_counts + noise.shot * std::sqrt(1000.0));
    for (const double difference : {1.1 * n, 2 * n, 10 * n}) {
        const double quotient = 1000 / (1000 + difference), share = n / difference;
        const double expected = 300 * (1 + (1 - share * share) * (quotient - 1));
        EXPECT_NEAR(followed<float>(1000, 1000, float(1000 + difference), 2, 300, noise), expected, 1e-3);
    }
}

// The Wiener filter's aim: over many pixels whose brightness changed, some much, some little, some not, the samples come nearer
// to the truth than untouched ones and than ones that take every quotient.
TEST(FollowedBrightness, comes_nearer_to_the_truth_than_nothing_and_than_every_quotient) {
    std::mt19937 random(9);
    std::normal_distribution<double> normal;
    const auto counted = [&](double mean) {
        return float(mean + (noise.read_counts + noise.shot * std::sqrt(mean)) * normal(random));
    };
    double untouched = 0, every = 0, ours = 0;
    for (int i = 0; i < 20000; ++i) {
        const double now = 1000, then = now * (1 + (i % 2 ? 0.05 : 0.0) * normal(random));
        const double truth = now / 4;
        const auto sample = float(then / 4);
        const float tracked_now = counted(now), tracked_then = counted(then);
        const auto squared = [&](double value) { return (value - truth) * (value - truth); };
        untouched += squared(sample);
        every += squared(sample * tracked_now / tracked_then);
        ours += squared(followed<float>(tracked_then, tracked_now, tracked_now, 0, sample, noise));
    }
    EXPECT_LT(ours, 0.95 * untouched);
    EXPECT_LT(ours, 0.75 * every);
}

TEST(FollowedBrightness, is_bounded_where_one_of_the_two_is_dark) {
    EXPECT_EQ(followed<int16_t>(0, 1000, 1000, 0, 100), 400);
    EXPECT_EQ(followed<int16_t>(-20, 1000, 1000, 0, 100), 400);
    EXPECT_EQ(followed<int16_t>(1000, 0, 0, 0, 100), 25);
    EXPECT_EQ(followed<int16_t>(1000, -20, 0, 0, 100), 25);
    EXPECT_EQ(followed<int16_t>(1000, 4000, 4000, 0, 16000), 16383) << "what shorts may hold";
}

TEST(FollowedBrightness, leaves_what_is_masked_here_or_in_a_tracking_frame) {
    constexpr int16_t masked = masked_sample<int16_t>;
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, 0, masked), masked);
    EXPECT_EQ(followed<int16_t>(masked, 1000, 500, 0.5, 300), 300);
    EXPECT_EQ(followed<int16_t>(500, masked, 500, 0.5, 300), 300);
    EXPECT_EQ(followed<int16_t>(masked, 1000, 500, 2, 300), 600) << "the other interval is seen";
    EXPECT_TRUE(std::isnan(followed<float>(500, 1000, 1000, 0, masked_sample<float>)));
}

TEST(FollowedBrightness, beyond_the_last_knot_stays_as_at_it) {
    EXPECT_EQ(followed<int16_t>(500, 1000, 500, 2.5, 300), 600);
    EXPECT_EQ(followed<int16_t>(500, 1000, 500, -0.5, 300), 600);
}

// What breaks it: two surfaces that differ by more than their albedo. Under lamp 0 the one is lit, under lamp 1 the other; the sum
// comes out right, its shares do not.
TEST(FollowedBrightness, of_another_surface_gives_the_sum_its_right_size_and_keeps_the_others_shares) {
    const float first[] = {800, 200}, second[] = {100, 400};
    const float all_first = first[0] + first[1], all_second = second[0] + second[1];
    float sum = 0;
    for (int lamp = 0; lamp < 2; ++lamp) {
        const float out = followed<float>(all_first, all_second, all_second, 0, first[lamp]);
        EXPECT_FLOAT_EQ(out, first[lamp] / all_first * all_second);
        sum += out;
    }
    EXPECT_FLOAT_EQ(sum, all_second);
}

// Every path, every kind of change, in a band that ends within a block.
TEST(FollowedBrightness, gives_the_same_bits_on_every_path_and_leaves_its_neighbours) {
    constexpr size_t samples = 203;
    std::mt19937 random(4);
    RowBand<int16_t> rows(4, samples), slot(1, samples);
    for (size_t p = 0; p < samples; ++p) {
        for (size_t k = 0; k < 4; ++k) rows.row(k)[p] = int16_t(random() % 4200 - 100);
        if (p % 17 == 0) rows.row(p % 4)[p] = masked_sample<int16_t>;
        slot.row(0)[p] = p % 23 == 0 ? masked_sample<int16_t> : int16_t(random() % 4200 - 100);
    }
    const BrightnessKnots knots{.ticks = {0, 1, 2, 3}, .light = std::vector(4, 1.0f), .instant = 1};
    std::vector<uint8_t> moves(samples);
    for (size_t p = 0; p < samples; ++p) moves[p] = p % 3 > 0;
    const FollowedBrightness<int16_t> brightness(rows, knots, noise, moves);
    std::vector<std::vector<int16_t>> results;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        RowBand<int16_t> out = slot;
        brightness.apply(2.3, out.row(0));
        results.emplace_back(out.row(0), out.row(0) + samples);
    }
    hwy::SetSupportedTargetsForTest(0);
    ASSERT_GT(results.size(), 1u);
    for (const auto& result : results) EXPECT_EQ(result, results[0]);
    for (size_t p = 0; p < samples; ++p) {
        RowBand<int16_t> alone(4, 1);
        for (size_t k = 0; k < 4; ++k) alone.row(k)[0] = rows.row(k)[p];
        RowBand<int16_t> one(1, 1);
        one.row(0)[0] = slot.row(0)[p];
        FollowedBrightness<int16_t>(alone, knots, noise, {&moves[p], 1}).apply(2.3, one.row(0));
        EXPECT_EQ(results[0][p], one.row(0)[0]) << p;
    }
}

// Lamps that are brighter by a third in a tracking slot say nothing of the subject.
TEST(FollowedBrightness, takes_light_that_all_pixels_have_more_of_for_the_lamps) {
    constexpr size_t samples = 400;
    std::mt19937 random(6);
    std::vector<RowBand<int16_t>> bands{{2, samples}};
    for (size_t p = 0; p < samples; ++p) {
        const int now = 300 + int(random() % 2700);
        bands[0].row(0)[p] = int16_t(std::lround(now * 4 / 3.0));
        bands[0].row(1)[p] = int16_t(now);
    }
    for (size_t p = 0; p < samples; p += 9) bands[0].row(0)[p] /= 2;  // some that the subject left
    const std::vector<float> light = relative_light<int16_t>(bands, 1, noise);
    EXPECT_NEAR(light[0], 4 / 3.0, 0.002);
    EXPECT_EQ(light[1], 1);
    RowBand<int16_t> slot(1, samples);
    std::fill_n(slot.row(0), samples, int16_t(500));
    const BrightnessKnots knots{.ticks = {0, 1}, .light = light, .instant = 1};
    const FollowedBrightness<int16_t> brightness(bands[0], knots, quiet, std::vector<uint8_t>(samples));
    brightness.apply(0, slot.row(0));
    for (size_t p = 0; p < samples; ++p) EXPECT_NEAR(slot.row(0)[p], p % 9 ? 500 : 1000, 3) << p;
}

TEST(RelativeLight, of_a_dark_frame_is_one) {
    std::vector<RowBand<float>> bands{{3, 500}};
    for (size_t k = 0; k < 3; ++k) std::fill_n(bands[0].row(k), 500, float(k));
    EXPECT_EQ(relative_light<float>(bands, 1, noise), (std::vector<float>{1, 1, 1}));
}
