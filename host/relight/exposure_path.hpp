// SPDX-License-Identifier: MIT
// Where a target's pixels are while a shutter is open: straight pieces between instants.
#pragma once

#include <vector>

#include "image/target_motion.hpp"

namespace ols {

struct ExposurePath {
    std::vector<double> times_s;   // opening, the instants between, closing
    std::vector<FlowField> moved;  // how far from home each pixel is at those times
    double extrapolated_s = 0;     // the longest time beyond the instants of the motion

    size_t pieces() const { return times_s.size() - 1; }
    double piece_s(size_t piece) const { return times_s[piece + 1] - times_s[piece]; }
};

// The motion's own instants and the target's, 0, between opening and closing; before the first and after the last of them
// the speed stays. A valid motion (check_motion) of one instant at least; open_s < close_s.
ExposurePath exposure_path(const TargetMotion& motion, double open_s, double close_s);

}  // namespace ols
