// SPDX-License-Identifier: MIT
// Motion that reverses inside a cycle, and tracking frames lost while it does: a single pace is wrong on either side, and the
// subject is between frames where a straight line does not lead.
// links: ols_develop
#include "develop/tracking_image.hpp"
#include "hard_case.hpp"
#include "moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr double amplitude_px = 8, period_slots = 240, radius = 40;

Offset swing(double slots) {
    return {amplitude_px * std::sin(2 * M_PI * slots / period_slots), 0};
}

std::vector<bool> inside() {
    std::vector<bool> counts;
    for (int y = 0; y < 120; ++y)
        for (int x = 0; x < 160; ++x) counts.push_back(std::hypot(x - 79.5, y - 59.5) < radius - 10);
    return counts;
}

// A pace that does not change: the flow to the next tracking frame, taken on to all others.
MotionPath at_one_pace(Take& take, uint64_t target) {
    const CameraCalibration& c = take.calibration();
    const Frame &here = *take.frame(target), &next = *take.frame(target + 18);
    const FlowField flow = *estimate_flow(tracking_image(here, c.black, c.flat), tracking_image(next, c.black, c.flat));
    const auto middle = [](const Frame& frame) { return double(frame.tick) + 0.5 * frame.exposure_ticks; };
    const std::vector<float> sure(flow.size(), 1.0f);
    return {{middle(here), FlowField(flow.width, flow.height), sure, true}, {middle(next), flow, sure, false}};
}

// Of the albedo, the root mean square slope along the motion, times that of the lamps' light: what a pixel off along it
// costs, r.
double cost_of_a_pixel(const Albedo& albedo) {
    double slopes = 0, lights = 0;
    for (int y = -30; y < 30; ++y)
        for (int x = -30; x < 30; ++x) slopes += std::pow(albedo(x + 0.5, y) - albedo(x - 0.5, y), 2) / 3600;
    for (const LightPosition& lamp : named_lamps())
        lights += std::pow(std::max(0.0, lamp.direction.z), 2) / sphere_lamp_count;
    return std::sqrt(slopes * lights);
}

void expect_followed(const std::string& name, const std::set<uint64_t>& lost_after, double gap_slots) {
    const Albedo albedo = wavy(2);
    const Scene scene{.layers = {{even(0)}, {albedo, radius, swing}}};
    const uint64_t target = Take(scene, "single").middle_target();
    std::set<uint64_t> lost;
    for (const uint64_t away : lost_after) lost.insert(target + away);
    Take take(scene, "single", lost);
    MotionDeveloper naive_developer = take.developer("standard"), developer = take.developer("standard");
    const MotionPath one_pace = at_one_pace(take, target);
    const std::vector<bool> counts = inside();
    const double naive = take.error(*naive_developer.develop(take.around(target), &one_pace), target, counts),
                 ours = take.error(*developer.develop(take.around(target)), target, counts),
                 none = take.error(take.develop("none", target), target, counts);
    // What noise and interpolation leave where the motion is known to be straight: nothing moves.
    Take still({.layers = {{even(0)}, {albedo, radius}}}, "single");
    const double noise = still.error(still.develop("none", target), target, counts);
    const double curvature = amplitude_px * std::pow(2 * M_PI / period_slots, 2);
    const double bent_px = curvature * gap_slots * gap_slots / 8, flow_px = 0.5;
    EXPECT_LT(ours, none) << name;
    expect_within(name, naive, ours, noise + (bent_px + flow_px) * cost_of_a_pixel(albedo), "r");
}

}  // namespace

// Bound of all: the noise of a still subject, and per pixel of misplacement what the albedo's slope costs. Between two knots h
// apart a path of curvature k leaves the straight line by k h^2 / 8 at most; flow may be half a pixel off before the
// forward-backward check calls it so.
TEST(ReversingMotion, is_followed_from_tracking_frame_to_tracking_frame) {
    expect_followed("motion that reverses inside a cycle, at the target's pace or as it is", {}, 18);
}

TEST(ReversingMotion, is_followed_across_a_lost_tracking_frame) {
    expect_followed("the same, a tracking frame lost", {36}, 36);
}

TEST(ReversingMotion, is_followed_across_two_lost_in_a_row) {
    expect_followed("the same, two tracking frames in a row lost", {36, 54}, 54);
}

TEST(ReversingMotion, is_followed_with_the_targets_own_tracking_frame_lost) {
    const Albedo albedo = wavy(2);
    const Scene scene{.layers = {{even(0)}, {albedo, radius, swing}}};
    const uint64_t target = Take(scene, "single").middle_target();
    Take take(scene, "single", {target});
    const double none = take.error(take.develop("none", target), target, inside()),
                 ours = take.error(take.develop("standard", target), target, inside());
    Take still({.layers = {{even(0)}, {albedo, radius}}}, "single");
    const double noise = still.error(still.develop("none", target), target, inside());
    const double bent_px = amplitude_px * std::pow(2 * M_PI / period_slots, 2) * 36 * 36 / 8;
    expect_within("the same, the target's own tracking frame lost, uncompensated or not", none, ours,
                  noise + (bent_px + 0.5) * cost_of_a_pixel(albedo), "r");
}
