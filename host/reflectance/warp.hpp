// SPDX-License-Identifier: MIT
// Warp: a plane of integer counts as it would look at the target's time, by bilinear interpolation in fixed point.
#pragma once

#include <cstdint>
#include <vector>

#include "reflectance/flow_field.hpp"

namespace ols {

// One colour plane of a frame: counts above black, masked_sample<int16_t> where there is none. Pitch in samples.
struct CountPlane {
    const int16_t* counts = nullptr;
    int width = 0, height = 0;
    size_t pitch = 0;
    int largest = 4095;  // |count| at most: up to 4095 two more bits are kept while interpolating
};

// Where the target's pixels are found in a slot that lies between two tracking frames (Wenger section 6, figure 7): at
// position + base + fraction * step, with base the long-range flow from the target to the nearest tracking frame, and step
// the local flow from there to the next one, both as vectors of the target's pixels.
struct SlotMotion {
    const FlowField* base = nullptr;
    const FlowField* step = nullptr;
    float fraction = 0;  // of the step: 0 at the tracking frame
};

// The step as the target sees it: local flow at position + base.
FlowField seen_from_target(const FlowField& base, const FlowField& local);

// A flow for every second pixel of every second row, beginning at (first_x, first_y), in units of that plane's pixels: what
// one colour of a mosaic needs.
FlowField of_color_plane(const FlowField& flow, int first_x, int first_y);

// out[y * out_pitch + x] = the bilinear mean of the four counts around the position, rounded. A position outside the plane,
// or one of whose counts with a weight above zero is masked, is masked. |counts| <= 16383; up to 4095 the result is within
// 0.7 counts of real arithmetic (half of that is its own rounding), above within 2. Integer arithmetic but for the position: the same
// bits on every SIMD path.
void warp_counts(const CountPlane& source, const SlotMotion& motion, int16_t* out, size_t out_pitch);

}  // namespace ols
