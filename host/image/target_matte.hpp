// SPDX-License-Identifier: MIT
// The matte of a target: what the camera saw of the subject before the lit board.
#pragma once

#include <vector>

namespace ols {

// The mean of the matte frames about a target, at the target's time; over a clean plate's it is the share of the background
// (Wenger section 7).
struct TargetMatte {
    int frames = 0;  // that it is the mean of; 0: there is no matte
    // [plane][y * width + x], in the lamps' unit; one plane, or three of an rgb target. A mosaic stays a mosaic.
    std::vector<std::vector<float>> planes;
    std::vector<float> variance;  // [y * width + x], mean over planes; empty if not known
};

}  // namespace ols
