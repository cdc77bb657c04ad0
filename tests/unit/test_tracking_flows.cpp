// SPDX-License-Identifier: MIT
// Paths through tracking frames, against motion in closed form.
// links: ols_develop
#include "develop/tracking_flows.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "flow_scenes.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

constexpr int width = 96, height = 72;
constexpr double frame_ticks = 1000, px_a_frame = 2.2;

// The whole image moves by px_a_frame a frame, and by a third of that downwards.
Image at_tick(double tick) {
    static const Texture texture = waves(7);
    const double shift = px_a_frame * tick / frame_ticks;
    Image image(width, height, 1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) image.at(x, y) = float(100 + 1900 * texture(x - shift, y - shift / 3));
    return image;
}

TrackingFlowOptions options(bool refines = true, int threads = 1) {
    TrackingFlowOptions made{.local = *flow_method("brox"), .refinement = {}, .threads = threads};
    if (refines) made.refinement = *flow_method("refine");
    return made;
}

TrackingFlows flows_of(const std::vector<int>& frames, const TrackingFlowOptions& made = options()) {
    TrackingFlows flows(made);
    for (const int frame : frames) EXPECT_TRUE(flows.add(frame * frame_ticks, at_tick(frame * frame_ticks)).ok());
    return flows;
}

// Away from the borders, where what comes in was not seen before.
void expect_true(const MotionKnot& knot, double instant, double tolerance) {
    const double truth = px_a_frame * (knot.tick - instant) / frame_ticks;
    for (int y = 24; y < height - 24; ++y)
        for (int x = 24; x < width - 24; ++x) {
            const size_t at = size_t(y) * width + size_t(x);
            ASSERT_NEAR(knot.flow.u[at], truth, tolerance) << "tick " << knot.tick;
            ASSERT_NEAR(knot.flow.v[at], truth / 3, tolerance) << "tick " << knot.tick;
            ASSERT_GT(knot.confidence[at], 0.8f) << "tick " << knot.tick;
        }
}

std::vector<double> frames_of(const MotionPath& path) {
    std::vector<double> ticks;
    for (const MotionKnot& knot : path) ticks.push_back(knot.tick / frame_ticks);
    return ticks;
}

}  // namespace

TEST(TrackingFlows, follow_an_even_motion_to_either_side) {
    TrackingFlows flows = flows_of({0, 1, 2, 3, 4, 5, 6, 7, 8});
    const auto path = flows.path(4000, 0, 8000);
    ASSERT_TRUE(path.ok());
    EXPECT_EQ(frames_of(*path), (std::vector<double>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
    for (const MotionKnot& knot : *path) {
        EXPECT_EQ(knot.is_instant, knot.tick == 4000);
        expect_true(knot, 4000, 0.1);
    }
}

TEST(TrackingFlows, span_a_lost_frame) {
    TrackingFlows flows = flows_of({0, 1, 2, 4, 5, 6});
    const auto path = flows.path(2000, 0, 6000);
    ASSERT_TRUE(path.ok());
    EXPECT_EQ(frames_of(*path), (std::vector<double>{0, 1, 2, 4, 5, 6}));
    for (const MotionKnot& knot : *path) expect_true(knot, 2000, 0.1);
}

TEST(TrackingFlows, find_an_instant_whose_own_frame_was_lost_between_its_neighbours) {
    TrackingFlows flows = flows_of({0, 1, 3, 4});
    for (const double instant : {2000.0, 1200.0, 2999.0}) {
        const auto path = flows.path(instant, 0, 4000);
        ASSERT_TRUE(path.ok());
        EXPECT_EQ(path->size(), 5u);
        for (const MotionKnot& knot : *path) expect_true(knot, instant, 0.15);
    }
}

TEST(TrackingFlows, reach_from_the_last_frame_before_to_the_first_after_as_far_as_there_are_any) {
    TrackingFlows flows = flows_of({0, 1, 2, 3, 4, 5});
    EXPECT_EQ(frames_of(*flows.path(3000, 1500, 3500)), (std::vector<double>{1, 2, 3, 4}));
    EXPECT_EQ(frames_of(*flows.path(3000, 2000, 4000)), (std::vector<double>{2, 3, 4}));
    EXPECT_EQ(frames_of(*flows.path(0, -9000, 1500)), (std::vector<double>{0, 1, 2}));
    EXPECT_EQ(frames_of(*flows.path(5000, 4500, 99000)), (std::vector<double>{4, 5}));
}

TEST(TrackingFlows, refine_what_is_near_and_concatenate_from_there) {
    TrackingFlows flows = flows_of({0, 1, 2, 3, 4, 5, 6}), coarse = flows_of({0, 1, 2, 3, 4, 5, 6}, options(false));
    const MotionPath all = *flows.path(3000, 0, 6000), some = *flows.path(3000, {0, 6000}, {1500, 4500}),
                     none = *coarse.path(3000, 0, 6000);
    for (const size_t k : {1, 2, 4, 5}) EXPECT_EQ(some[k].flow.u, all[k].flow.u) << k;
    for (const size_t k : {0, 6}) {
        EXPECT_NE(some[k].flow.u, all[k].flow.u);
        EXPECT_NE(some[k].flow.u, none[k].flow.u);
        expect_true(some[k], 3000, 0.15);
    }
}

TEST(TrackingFlows, leave_an_instant_outside_all_frames_alone) {
    TrackingFlows flows = flows_of({1, 2, 3});
    for (const double instant : {0.0, 3001.0}) {
        const auto path = flows.path(instant, instant - 2000, instant + 2000);
        ASSERT_TRUE(path.ok());
        ASSERT_EQ(path->size(), 1u);
        EXPECT_TRUE(path->front().is_instant);
    }
}

TEST(TrackingFlows, give_the_same_bits_for_any_number_of_threads) {
    TrackingFlows one = flows_of({0, 1, 2, 4, 5}, options(true, 1)), four = flows_of({0, 1, 2, 4, 5}, options(true, 4));
    for (const double instant : {2000.0, 3000.0}) {
        const MotionPath a = *one.path(instant, 0, 5000), b = *four.path(instant, 0, 5000);
        ASSERT_EQ(a.size(), b.size());
        for (size_t k = 0; k < a.size(); ++k) {
            EXPECT_EQ(a[k].flow.u, b[k].flow.u);
            EXPECT_EQ(a[k].flow.v, b[k].flow.v);
            EXPECT_EQ(a[k].confidence, b[k].confidence);
        }
    }
}

TEST(TrackingFlows, give_the_same_whether_frames_before_were_forgotten) {
    TrackingFlows all = flows_of({0, 1, 2, 3, 4}), late = flows_of({0, 1, 2, 3, 4});
    late.forget_before(1500);
    const MotionPath a = *all.path(2000, 1000, 3000), b = *late.path(2000, 1000, 3000);
    ASSERT_EQ(frames_of(a), frames_of(b));
    for (size_t k = 0; k < a.size(); ++k) EXPECT_EQ(a[k].flow.u, b[k].flow.u);
}

TEST(TrackingFlows, of_reduced_images_are_in_their_pixels) {
    TrackingFlowOptions half = options();
    half.reduced_side = height / 2;
    TrackingFlows flows = flows_of({0, 1, 2}, half);
    const MotionPath path = *flows.path(1000, 0, 2000);
    EXPECT_EQ(path[2].flow.width, width / 2);
    EXPECT_NEAR(path[2].flow.u[18 * 48 + 24], px_a_frame / 2, 0.1);
}

TEST(TrackingFlows, say_what_is_wrong_with_their_images) {
    TrackingFlows flows(options());
    EXPECT_FALSE(flows.path(0, 0, 0).ok()) << "no frame at all";
    const Status small = flows.add(0, Image(15, 40, 1));
    ASSERT_FALSE(small.ok());
    EXPECT_NE(small.error().message.find("at least 16"), std::string::npos);
    TrackingFlows sized(options());
    ASSERT_TRUE(sized.add(0, Image(40, 40, 1)).ok());
    EXPECT_FALSE(sized.add(1, Image(40, 41, 1)).ok());
}

// u = a x + b: x' + share u(x') = x has the solution x' = (x - share b) / (1 + share a).
TEST(SplitFlow, is_the_closed_form_of_a_zoom) {
    constexpr double a = 0.05, b = 1.5;
    FlowField between(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) between.u[size_t(y * width + x)] = float(a * x + b);
    for (const double share : {0.25, 0.5, 0.9}) {
        const SplitFlow parts = split(between, share);
        for (int x = 10; x < width - 10; ++x) {
            const double first = (x - share * b) / (1 + share * a), u = a * first + b;
            ASSERT_NEAR(parts.to_first.u[size_t(30 * width + x)], first - x, 1e-3) << share;
            ASSERT_NEAR(parts.to_second.u[size_t(30 * width + x)], (1 - share) * u, 1e-3) << share;
        }
    }
}

TEST(SplitFlow, stays_between_the_vectors_of_both_sides_at_an_edge_of_motion) {
    FlowField between(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width / 2; ++x)
            between.u[size_t(y * width + x)] = 12;  // the left half covers the right one
    const SplitFlow parts = split(between, 0.5);
    for (size_t p = 0; p < between.size(); ++p) {
        ASSERT_GE(parts.to_second.u[p], -1e-4f);
        ASSERT_LE(parts.to_second.u[p], 6 + 1e-4f);
    }
}
