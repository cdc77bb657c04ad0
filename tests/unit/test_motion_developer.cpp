// SPDX-License-Identifier: MIT
// Whole targets of takes whose motion is known: what must not change a bit, and what must stay bounded.
// links: ols_develop
#include "develop/motion_developer.hpp"

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

// Noise and all, where the flow is zero.
TEST(MotionDeveloper, leaves_every_bit_of_a_subject_whose_flow_is_zero) {
    Take take(scene({{wavy(3)}}), "s159");
    const TargetFrames frames = take.around(take.middle_target());
    MotionPath path;
    for (const auto& [number, frame] : frames.tracking) {
        path.push_back({middle_tick(*frame), FlowField(80, 64), std::vector<float>(80 * 64, 1.0f), false});
        path.back().is_instant = number == frames.basis.target;
    }
    const Target still = take.develop("none", take.middle_target());
    for (const char* quality : {"preview", "standard", "final"}) {
        MotionDeveloper developer = take.developer(quality);
        expect_equal(*developer.develop(frames, &path), still);
    }
}

// Under light that grows evenly with time, the nearer frames of the lamps that shine first are too bright, those of the last too
// dark; half a cycle off by a tenth.
TEST(MotionDeveloper, finds_light_that_changes_evenly_between_the_frames_before_and_after) {
    Layer card = moving_disc(20);
    card.brightness = [](double slots) { return 1 + 0.2 * slots / 180; };
    Scene without_noise = scene({{even(0)}, card}, false);
    Take take(without_noise, "single");
    std::vector<bool> inside;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 80; ++x) inside.push_back(std::hypot(x - 39.5, y - 31.5) < 15);
    const uint64_t target = take.middle_target();
    MotionQuality quality = *motion_quality("standard");
    quality.follows_brightness = false;
    const auto error = [&] {
        MotionDeveloper developer(take.sequence(), take.calibration(), {}, {}, quality);
        return take.error(*developer.develop(take.around(target)), target, inside);
    };
    const double blended = error();
    quality.interpolates = false;
    EXPECT_LT(blended, error() / 3);
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
    // With flow between all tracking frames; and between some, which are counted from every fifth.
    for (const auto& [quality, apart] : {std::pair("standard", 18), std::pair("preview", 90)}) {
        MotionDeveloper developer = take.developer(quality);
        for (const int before : {2, 1})
            ASSERT_TRUE(developer.develop(take.around(target - uint64_t(before * apart))).ok());
        expect_equal(*developer.develop(take.around(target)), take.develop(quality, target));
    }
}

// The tracking frames that flow leads to, counted from the target's.
std::vector<long> flow_frames(Take& take, MotionDeveloper& developer, uint64_t target) {
    std::vector<long> frames;
    const MotionPath path = *developer.find_path(take.around(target));
    const auto tick = double(target) * 57870;
    for (const MotionKnot& knot : path) frames.push_back(std::lround((knot.tick - tick) / (18 * 57870)));
    return frames;
}

// At 24 targets a second every fifth tracking frame is one: flow leads from there over the third between them.
TEST(MotionDeveloper, finds_flow_between_tracking_frames_as_far_apart_as_its_quality_says) {
    Take take(scene({{wavy(5)}, moving_disc(20)}), "single");
    const uint64_t target = take.middle_target();
    MotionDeveloper preview = take.developer("preview"), standard = take.developer("standard");
    const std::vector<long> apart = {-5, -2, 0, 3, 5};
    EXPECT_EQ(flow_frames(take, preview, target - 90), apart);
    EXPECT_EQ(flow_frames(take, preview, target), apart) << "whichever target came before";
    const std::vector<long> all = flow_frames(take, standard, target);
    for (long k = -5; k <= 5; ++k) EXPECT_NE(std::ranges::find(all, k), all.end()) << k;
}

TEST(MotionDeveloper, finds_flow_to_the_neighbours_of_a_frame_that_was_lost_and_to_the_takes_ends) {
    Scene disc = scene({{wavy(5)}, moving_disc(3)});
    disc.width = 48, disc.height = 40;
    const uint64_t target = Take(disc, "single").middle_target();
    const auto frames = [&](const std::set<uint64_t>& lost, uint64_t at) {
        Take take(disc, "single", lost);
        MotionDeveloper preview = take.developer("preview");
        return flow_frames(take, preview, at);
    };
    EXPECT_EQ(frames({target}, target), (std::vector<long>{-5, -2, -1, 0, 1, 3, 5}));
    EXPECT_EQ(frames({target + 3 * 18}, target), (std::vector<long>{-5, -2, 0, 2, 4, 5}));
    EXPECT_EQ(frames({target + 18}, target), (std::vector<long>{-5, -2, 0, 3, 5})) << "no flow leads there anyway";
    const uint64_t last = target + 15 * 18;  // of the third cycle, whose last tracking frame is the fourth after it
    EXPECT_EQ(frames({}, last), (std::vector<long>{-5, -2, 0, 3, 4}));
}

// A disc that is darker about one tracking frame only, which no flow leads to.
TEST(MotionDeveloper, follows_the_brightness_of_tracking_frames_that_flow_leaves_out) {
    Layer dimmed = moving_disc(0);
    dimmed.brightness = [](double slots) { return 1 - std::max(0.0, 0.6 * (1 - std::abs(slots - 18) / 18)); };
    Take take(scene({{even(0.3)}, dimmed}, false), "single");
    std::vector<bool> inside;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 80; ++x) inside.push_back(std::hypot(x - 39.5, y - 31.5) < 15);
    const uint64_t target = take.middle_target();
    const double none = take.error(take.develop("none", target), target, inside);
    EXPECT_LT(take.error(take.develop("preview", target), target, inside), none / 5);
}

TEST(MotionDeveloper, keeps_no_more_the_longer_a_take_is) {
    Scene small = scene({{wavy(5)}, moving_disc(3)});
    small.width = 48, small.height = 40;
    Take take(small, "single", {}, 8);
    const std::vector<uint64_t> targets = target_numbers(take.sequence(), 1);
    ASSERT_GE(targets.size(), 50u);
    // A basis, or one on either side, and tracking frames of a cycle to either side of the target.
    struct Bound {
        const char* quality;
        unsigned bases, tracking_frames;
    };
    for (const auto& [quality, bases, tracking_frames] : {Bound{"preview", 1, 12}, Bound{"standard", 2, 32}}) {
        MotionDeveloper developer = take.developer(quality);
        for (size_t i = 0; i < 50; i += 5) {
            ASSERT_TRUE(developer.develop(take.around(targets[i])).ok());
            const MotionDeveloper::Kept kept = developer.kept();
            EXPECT_LE(kept.basis_frames, 156 * bases);
            EXPECT_GE(kept.basis_frames, 156u);
            EXPECT_LE(kept.tracking_frames, tracking_frames);
        }
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

TEST(MotionDeveloper, takes_from_across_the_target_what_flow_reaches_and_says_how_many) {
    const auto slots_from_both_sides = [](std::set<uint64_t> lost) {
        Take take(scene({{wavy(5)}, moving_disc(20)}), "single", std::move(lost));
        const Target target = take.develop("standard", take.middle_target());
        return target.provenance["slots_from_both_sides"].get<int>();
    };
    EXPECT_EQ(slots_from_both_sides({}), 156);
    // The tracking frames after half a cycle: what is across lies up to half a cycle beyond the last one.
    std::set<uint64_t> late;
    for (uint64_t number = 180 + 108; number < 540; number += 18) late.insert(number);
    const int reached = slots_from_both_sides(late);
    EXPECT_GT(reached, 0);
    EXPECT_LT(reached, 156 * 2 / 3);
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
