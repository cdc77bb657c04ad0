// SPDX-License-Identifier: MIT
// Samples that follow the brightness of the tracking frames: the factor's closed form, and what must not move.
// links: ols_capture
#include <gtest/gtest.h>

#include <cmath>

#include "capture/followed_brightness.hpp"
#include "reflectance/masked_sample.hpp"

using namespace ols;

namespace {

template <typename Sum>
using Plane = std::vector<Sum, PlaneAllocator<Sum>>;

const NoiseModel noise;

// Three knots, the target's in the middle.
template <typename Sum>
Sum followed(Sum before, Sum now, Sum after, Alignment::Place place, Sum sample) {
    const FollowedBrightness brightness(FollowedBrightness::Knots<Sum>{{before}, {now}, {after}}, 1, noise);
    Plane<Sum> samples{sample};
    brightness.apply(place, std::span<Sum>(samples));
    return samples[0];
}

}  // namespace

TEST(FollowedBrightness, multiplies_by_the_quotient_of_the_target_and_the_slots_own_time) {
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, {0, 0.0f}, 300), 600);
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, {0, 0.25f}, 300), 480) << "625 counts a quarter of the way";
    EXPECT_EQ(followed<int32_t>(1000, 1000, 2000, {1, 0.5f}, -300), -200);
    EXPECT_FLOAT_EQ(followed<float>(1000, 1000, 2000, {1, 1.0f}, 3.5f), 1.75f);
}

TEST(FollowedBrightness, leaves_to_the_bit_what_changes_less_than_noise_may) {
    const double sigma = noise.read_counts + noise.shot * std::sqrt(1000.0);
    const auto least = float(6 * std::sqrt(2.0) * sigma);
    EXPECT_EQ(followed<float>(1000, 1000, 1000 + 0.99f * least, {1, 1.0f}, 123.25f), 123.25f);
    EXPECT_NE(followed<float>(1000, 1000, 1000 + 1.01f * least, {1, 1.0f}, 123.25f), 123.25f);
    EXPECT_EQ(followed<float>(2000, 1000, 1000, {1, 0.5f}, 123.25f), 123.25f) << "another interval's change";
}

TEST(FollowedBrightness, is_bounded_where_one_of_the_two_is_dark) {
    EXPECT_EQ(followed<int16_t>(0, 1000, 1000, {0, 0.0f}, 100), 400);
    EXPECT_EQ(followed<int16_t>(-20, 1000, 1000, {0, 0.0f}, 100), 400);
    EXPECT_EQ(followed<int16_t>(1000, 0, 0, {0, 0.0f}, 100), 25);
    EXPECT_EQ(followed<int16_t>(1000, -20, 0, {0, 0.0f}, 100), 25);
    EXPECT_EQ(followed<int16_t>(1000, 4000, 4000, {0, 0.0f}, 16000), 16383) << "what shorts may hold";
}

TEST(FollowedBrightness, leaves_what_is_masked_here_or_in_a_tracking_frame) {
    constexpr int16_t masked = masked_sample<int16_t>;
    EXPECT_EQ(followed<int16_t>(500, 1000, 1000, {0, 0.0f}, masked), masked);
    EXPECT_EQ(followed<int16_t>(masked, 1000, 500, {0, 0.5f}, 300), 300);
    EXPECT_EQ(followed<int16_t>(500, masked, 500, {0, 0.5f}, 300), 300);
    EXPECT_EQ(followed<int16_t>(masked, 1000, 500, {1, 1.0f}, 300), 600) << "the other interval is seen";
    EXPECT_TRUE(std::isnan(followed<float>(500, 1000, 1000, {0, 0.0f}, masked_sample<float>)));
}

TEST(FollowedBrightness, beyond_the_last_knot_stays_as_at_it) {
    EXPECT_EQ(followed<int16_t>(500, 1000, 500, {1, 1.5f}, 300), 600);
    EXPECT_EQ(followed<int16_t>(500, 1000, 500, {0, -0.5f}, 300), 600);
}

// What breaks it: two surfaces that differ by more than their albedo. Under lamp 0 the one is lit, under lamp 1 the other; the sum
// comes out right, its shares do not.
TEST(FollowedBrightness, of_another_surface_gives_the_sum_its_right_size_and_keeps_the_others_shares) {
    const float first[] = {800, 200}, second[] = {100, 400};
    const float all_first = first[0] + first[1], all_second = second[0] + second[1];
    float sum = 0;
    for (int lamp = 0; lamp < 2; ++lamp) {
        const float out = followed<float>(all_first, all_second, all_second, {0, 0.0f}, first[lamp]);
        EXPECT_FLOAT_EQ(out, first[lamp] / all_first * all_second);
        sum += out;
    }
    EXPECT_FLOAT_EQ(sum, all_second);
}
