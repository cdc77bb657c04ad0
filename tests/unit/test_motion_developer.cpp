// SPDX-License-Identifier: MIT
// Whole targets of takes whose motion is known: what must not change a bit, and what must stay bounded.
// links: ols_capture
#include "capture/motion_developer.hpp"

#include <gtest/gtest.h>

#include "../stability/moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

Layer moving_disc(double px_a_cycle) {
    return {wavy(2), 22, [=](double slots) { return Offset{px_a_cycle * slots / 180, 0}; }};
}

Scene scene(std::vector<Layer> layers, bool is_noisy = true) {
    return {.layers = std::move(layers), .width = 80, .height = 64, .is_noisy = is_noisy};
}

void expect_equal(const Target& a, const Target& b) {
    EXPECT_EQ(a.lamps, b.lamps);
    EXPECT_EQ(a.mask, b.mask);
    EXPECT_EQ(a.variance, b.variance);
}

}  // namespace

TEST(MotionDeveloper, leaves_every_bit_of_a_subject_that_stands_still) {
    Take take(scene({{wavy(3)}}, false), "s159");
    const Target still = take.develop("none", take.middle_target());
    for (const char* quality : {"preview", "standard", "final"})
        expect_equal(take.develop(quality, take.middle_target()), still);
}

TEST(MotionDeveloper, gives_the_same_bits_on_one_thread_and_on_two) {
    Take take(scene({{wavy(5)}, moving_disc(20)}), "s159");
    for (const char* quality : {"preview", "standard"}) {
        const Target one = take.develop(quality, take.middle_target(), {Estimate::none, {}, 1});
        const Target two = take.develop(quality, take.middle_target(), {Estimate::none, {}, 2});
        expect_equal(one, two);
        EXPECT_EQ(one.confidence, two.confidence);
        ASSERT_EQ(one.motion.flows.size(), two.motion.flows.size());
        for (size_t k = 0; k < one.motion.flows.size(); ++k) EXPECT_EQ(one.motion.flows[k].u, two.motion.flows[k].u);
    }
}

TEST(MotionDeveloper, gives_a_target_the_same_bits_whichever_came_before) {
    Take take(scene({{wavy(5)}, moving_disc(20)}), "single");
    const uint64_t target = take.middle_target();
    MotionDeveloper developer = take.developer("standard");
    for (const uint64_t before : {target - 36, target - 18}) ASSERT_TRUE(developer.develop(take.around(before)).ok());
    expect_equal(*developer.develop(take.around(target)), take.develop("standard", target));
}

TEST(MotionDeveloper, keeps_no_more_the_longer_a_take_is) {
    Scene small = scene({{wavy(5)}, moving_disc(3)});
    small.width = 48, small.height = 40;
    Take take(small, "single", {}, 8);
    MotionDeveloper developer = take.developer("preview");
    const std::vector<uint64_t> targets = target_numbers(take.sequence(), 1);
    ASSERT_GE(targets.size(), 50u);
    for (size_t i = 0; i < 50; ++i) {
        ASSERT_TRUE(developer.develop(take.around(targets[i])).ok());
        const MotionDeveloper::Kept kept = developer.kept();
        // A basis, and tracking frames of a cycle to either side of the target.
        EXPECT_EQ(kept.basis_frames, 156u);
        EXPECT_LE(kept.tracking_frames, 22u);
    }
}

TEST(MotionDeveloper, makes_moving_lamps_right_as_far_as_motion_is_known) {
    // The disc's inside, a pixel of interpolation and of flow's softness from its edge.
    Take take(scene({{even(0)}, moving_disc(20)}), "s159");
    std::vector<bool> inside;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 80; ++x) inside.push_back(std::hypot(x - 39.5, y - 31.5) < 15);
    const uint64_t target = take.middle_target();
    const double uncompensated = take.error(take.develop("none", target), target, inside);
    for (const char* quality : {"preview", "standard"})
        EXPECT_LT(take.error(take.develop(quality, target), target, inside), uncompensated / 2) << quality;
}

TEST(MotionDeveloper, without_a_tracking_frame_moves_nothing_and_trusts_nothing) {
    std::set<uint64_t> lost;
    for (uint64_t group = 0; group < 30; ++group) lost.insert(group * 18);
    Take take(scene({{wavy(5)}, moving_disc(20)}), "single", lost);
    const uint64_t target = take.middle_target();
    const Target without = take.develop("standard", target), none = take.develop("none", target);
    EXPECT_EQ(without.lamps, none.lamps);
    for (const uint32_t mask : without.mask) EXPECT_TRUE(mask & mask_misaligned);
}

TEST(MotionDeveloper, refuses_a_target_without_any_frame) {
    Take take(scene({{wavy(5)}}), "single");
    TargetFrames frames = take.around(take.middle_target());
    frames.frames.clear(), frames.basis.choices.clear();
    MotionDeveloper developer = take.developer("standard");
    const auto refused = developer.develop(frames);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("every basis slot"), std::string::npos);
}
