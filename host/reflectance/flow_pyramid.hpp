// SPDX-License-Identifier: MIT
// Two images at falling resolutions, and the way from the coarsest to the finest that the variational flows share.
#pragma once

#include <functional>
#include <vector>

#include "reflectance/flow_field.hpp"

namespace ols {

// What of an image's brightness is compared: image - share * blurred(image), over the standard deviation of both images. Taking the
// coarse part out at each level removes shading, which stays with the lamps while the subject moves, and gives fine texture
// the say (as the structure-texture decomposition of Wedel et al. 2009, but linear).
struct FlowDetail {
    float share = 0.9f;
    int radius = 4;          // pixels of the level: the blur is a box of 2 radius + 1, twice
    float smoothing = 0.5f;  // pixels of full resolution: a blur before all else, against noise
};

struct FlowPyramid {
    std::vector<FlowPair> levels;  // of detail, from full resolution down
    double ratio = 0.5;            // of a level's sides to those of the level before
};

// No level but the first has a side shorter than `coarsest` pixels.
FlowPyramid flow_pyramid(const FlowPair& pair, double ratio, int coarsest, const FlowDetail& detail);

// Solves level after level, from the coarsest to `finest_level`; `solve` takes a level's flow from where the last one ended.
// With `initial` (full resolution), from that flow, at the first level that is no finer than twice the finest: what is left
// to find is small. The result has full resolution.
using SolveLevel = std::function<FlowField(size_t level, const FlowField& begin)>;
FlowField coarse_to_fine(const FlowPyramid& pyramid, int finest_level, const FlowField* initial,
                         const SolveLevel& solve);

// A 5 x 5 median of each component (Sun, Roth and Black, "Secrets of optical flow estimation and their principles", CVPR
// 2010): takes out what a robust data term left standing alone.
void median_filter(FlowField& flow);

}  // namespace ols
