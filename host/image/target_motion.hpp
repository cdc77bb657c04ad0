// SPDX-License-Identifier: MIT
// The motion of a target: where its pixels are at instants before and after its own.
#pragma once

#include <vector>

#include "image/flow_field.hpp"
#include "result.hpp"

namespace ols {

// In order of time. The target's own instant, 0, at which nothing has moved, is not listed.
struct TargetMotion {
    std::vector<double> times_s;   // relative to the target
    std::vector<FlowField> flows;  // one an instant: what the target shows at (x, y) is at (x + u, y + v) then
};

// Errors: times that do not ascend, are 0 or not finite.
Status check_motion_times(const std::vector<double>& times_s);

// Errors: those of the times; flows that are not as many as times, not of the target's size, or
// not finite.
Status check_motion(const TargetMotion& motion, int width, int height);

}  // namespace ols
