// SPDX-License-Identifier: MIT
// A periodic texture over several tracking frames: the far ones look the same shifted by whole periods.
// links: ols_develop
#include "develop/tracking_image.hpp"
#include "hard_case.hpp"
#include "moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr double period_px = 12;

Albedo periodic() {
    return [](double x, double y) {
        return 0.5 + 0.2 * (std::sin(2 * M_PI * x / period_px) + std::sin(2 * M_PI * y / period_px));
    };
}

double mean_error(const FlowField& flow, double truth) {
    double sum = 0, count = 0;
    for (int y = 20; y < flow.height - 20; ++y)
        for (int x = 30; x < flow.width - 30; ++x) {
            const size_t at = size_t(y) * size_t(flow.width) + size_t(x);
            sum += std::hypot(double(flow.u[at]) - truth, double(flow.v[at])), ++count;
        }
    return sum / count;
}

}  // namespace

// Bound: half a pixel, what flow may be off by. From one tracking frame that flow leads to to the next the texture moves by less
// than half a period, where the nearest match is the right one; all that follows begins within half a period of the truth.
// `preview` leads to the third and the fifth, and follows half of the speed.
TEST(PeriodicTexture, is_followed_over_a_period_and_more) {
    struct Case {
        const char* quality;
        double px_a_frame;
        std::vector<uint64_t> frames;
    };
    for (const auto& [quality, px_a_frame, frames] :
         {Case{"standard", 2.5, {0, 1, 2, 3, 4, 5}}, Case{"preview", 1.25, {0, 3, 5}}}) {
        Take take({.layers = {{periodic(), INFINITY,
                               [px = px_a_frame](double slots) {
                                   return Offset{px * slots / 18, 0};
                               }}}},
                  "single");
        const uint64_t target = take.middle_target();
        const Image black = take.calibration().black, flat = take.calibration().flat;
        const auto image = [&](uint64_t number) { return tracking_image(*take.frame(number), black, flat); };
        const TrackingFlowOptions options = motion_quality(quality)->flow;
        TrackingFlows flows(options);
        for (const uint64_t frame : frames) {
            const uint64_t number = target + 18 * frame;
            ASSERT_TRUE(flows.add(take.time_of(number), image(number)).ok());
        }
        const double instant = take.time_of(target);
        const MotionPath path = *flows.path(instant, instant, instant + 90);
        const double reduced = double(path.back().flow.width) / black.width, truth = 5 * px_a_frame * reduced;
        const double ours = mean_error(path.back().flow, truth);
        const double naive =
            mean_error(*estimate_flow(image(target), image(target + 90), options.local), 5 * px_a_frame);
        if (quality == std::string("standard"))
            expect_within(
                "a texture of 12 px period moved by 12.5 px over five tracking frames, at once or frame by frame: mean "
                "endpoint error",
                naive, ours, 0.5, "px");
        else
            EXPECT_LT(ours, 0.5 * reduced);
    }
}
