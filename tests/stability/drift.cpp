// SPDX-License-Identifier: MIT
// Errors of flow add up over a long concatenation.
// links: ols_develop
#include <random>

#include "../unit/flow_scenes.hpp"
#include "develop/tracking_flows.hpp"
#include "hard_case.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

constexpr int width = 160, height = 120, frames = 21;
constexpr double turn_deg = 0.8, shift_px = 0.63;  // a frame

Motion motion_until(int frame) {
    return similarity(turn_deg * frame, 1, shift_px * frame, 0, width / 2.0, height / 2.0);
}

Image frame_at(int frame) {
    static const Texture texture = waves(11);
    Image image = plane_scene("turning", width, height, texture, motion_until(frame)).to;
    add_noise(image, unsigned(frame));
    return image;
}

// The mean error of a flow from one frame to another over what stays 16 pixels inside.
double error_of(const FlowField& flow, int to, int from = 0) {
    const Motion until_from = motion_until(from), until_to = motion_until(to);
    double sum = 0, count = 0;
    for (int y = 16; y < height - 16; ++y)
        for (int x = 16; x < width - 16; ++x) {
            const auto [first_x, first_y] = until_from.backward(x, y);
            const auto [tx, ty] = until_to.forward(first_x, first_y);
            if (tx < 16 || ty < 16 || tx > width - 17 || ty > height - 17) continue;
            const size_t at = size_t(y * width + x);
            sum += std::hypot(x + double(flow.u[at]) - tx, y + double(flow.v[at]) - ty), ++count;
        }
    return sum / count;
}

std::vector<double> errors_along(const TrackingFlowOptions& options) {
    TrackingFlows flows(options);
    for (int frame = 0; frame < frames; ++frame) EXPECT_TRUE(flows.add(frame, frame_at(frame)).ok());
    const MotionPath path = *flows.path(0, 0, frames - 1);
    std::vector<double> errors;
    for (int frame = 0; frame < frames; ++frame) errors.push_back(error_of(path[size_t(frame)].flow, frame));
    return errors;
}

}  // namespace

// Bound: what the refinement errs when it begins at the truth, and what one flow errs. Each refined flow begins from the last
// one and a local flow, however far the instant is: off by what the last one and a local flow err, which is within what the
// refinement's coarsest level resolves. Of the first it leaves what it errs anyway, of the second all of it at worst.
TEST(Drift, does_not_grow_where_long_flows_are_refined) {
    TrackingFlowOptions refined{.local = *flow_method("brox-half"), .refinement = *flow_method("refine")},
        concatenated = refined;
    concatenated.refinement.reset();
    const std::vector<double> naive = errors_along(concatenated), ours = errors_along(refined);
    FlowField truth(width, height);
    const Motion motion = motion_until(frames - 1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const auto [tx, ty] = motion.forward(x, y);
            truth.u[size_t(y * width + x)] = float(tx - x), truth.v[size_t(y * width + x)] = float(ty - y);
        }
    const double from_truth =
        error_of(*estimate_flow(frame_at(0), frame_at(frames - 1), *refined.refinement, &truth), frames - 1);
    expect_within("flow over 20 tracking frames, concatenated or refined: mean endpoint error", naive.back(),
                  ours.back(), from_truth + ours[1], "px");
}

// The motion is rigid, so that an error once made is carried along as long as it is: the errors of all flows add up at most.
TEST(Drift, of_a_plain_concatenation_is_the_sum_of_all_flows_errors_at_most) {
    const TrackingFlowOptions concatenated{.local = *flow_method("brox-half"), .refinement = {}};
    const std::vector<double> errors = errors_along(concatenated);
    double sum = 0;
    for (int frame = 1; frame < frames; ++frame) {
        const FlowField local = *estimate_flow(frame_at(frame - 1), frame_at(frame), concatenated.local);
        sum += error_of(local, frame, frame - 1);
        EXPECT_LE(errors[size_t(frame)], sum) << frame;
    }
}
