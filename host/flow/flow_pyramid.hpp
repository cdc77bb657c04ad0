// SPDX-License-Identifier: MIT
// Two images at falling resolutions, and the way from the coarsest to the finest that the variational flows share.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "flow/flow_field.hpp"

namespace ols {

// What of an image's brightness is compared: image - share * blurred(image), over the standard deviation of both images. Taking the
// coarse part out at each level removes shading, which stays with the lamps while the subject moves, and gives fine texture
// the say (as the structure-texture decomposition of Wedel et al. 2009, but linear).
struct FlowDetail {
    float share = 0.9f;
    int radius = 4;          // pixels of the level: the blur is a box of 2 radius + 1, twice
    float smoothing = 0.5f;  // pixels of full resolution: a blur before all else, against noise
};

// Which resolutions are worked at. Level 0 is full resolution, whose sides shrink by `ratio` from level to level.
struct FlowLevels {
    double ratio = 0.5;
    int coarsest = 16;                                         // pixels: no level but the first has a shorter side
    int finest = 0;                                            // where it ends; the flow is enlarged from there
    double octaves = std::numeric_limits<double>::infinity();  // by which the coarsest lies above the finest, at most
};

struct FlowPyramid {
    int width = 0, height = 0;     // of full resolution
    std::vector<FlowPair> levels;  // of detail, from the finest down
};

FlowPyramid flow_pyramid(const FlowPair& pair, const FlowLevels& which, const FlowDetail& detail);

// Solves level after level, from the coarsest to the finest; `solve` takes a level's flow from where the last one ended, and
// level 0 is the finest. Begins with `initial` (full resolution), or zero. The result has full resolution.
using SolveLevel = std::function<FlowField(size_t level, const FlowField& begin)>;
FlowField coarse_to_fine(const FlowPyramid& pyramid, const FlowField* initial, const SolveLevel& solve);

// A 5 x 5 median of each component (Sun, Roth and Black, "Secrets of optical flow estimation and their principles", CVPR
// 2010): takes out what a robust data term left standing alone.
void median_filter(FlowField& flow);

}  // namespace ols
