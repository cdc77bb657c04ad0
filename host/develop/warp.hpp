// SPDX-License-Identifier: MIT
// Warp: a frame of integer counts as it would look at the target's time, by bilinear interpolation in fixed point.
#pragma once

#include <cstdint>

#include "develop/group_motion.hpp"

namespace ols {

// A frame, or one channel of it: counts above black, masked_sample<int16_t> where there is none. In a mosaic the colours lie as
// the camera has them; each is interpolated among its own samples, which are a step of the grid apart. Pitch in samples.
struct CountPlane {
    const int16_t* counts = nullptr;
    SampleGrid grid;
    size_t pitch = 0;
    int largest = 4095;        // |count| at most: up to 4095 two more bits are kept while interpolating
    bool holds_edges = false;  // a position outside takes the nearest count of the edge
    int margin = 0;            // with holds_edges: as many columns and rows beyond each edge may be read, and repeat it
    // Of the plane that is warped next, of the same grid, pitch and margin: what lies there where this one is read is fetched from
    // memory meanwhile. May be null.
    const int16_t* next = nullptr;
};

struct RowRange {
    int first = 0, count = 0;
};

// The rows of `range` of the slot at a fraction of the group's step: 0 at the tracking frame nearer to the target.
// out[(y - range.first) * out_pitch + x] = the bilinear mean of the four counts around the position, rounded. A position outside
// the frame (unless it holds its edges), or one of whose counts with a weight above zero is masked, is masked. |counts| <= 16383;
// up to 4095 interpolation keeps two more bits. Integer arithmetic but for the position: the same bits on every SIMD path and
// for any range. A margin makes it faster where motion leads out; there a run may lie on a line that else keeps its own
// vectors. Where the position is on a line it is within 2^-10 steps of it. The grid is the motion's. False where it is known
// that no count that was written is masked.
bool warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                 int16_t* out, size_t out_pitch);
// All rows.
bool warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, int16_t* out, size_t out_pitch);

// The same of a source that does not quantise: NaN where there is none. Pitch in samples.
struct SamplePlane {
    const float* samples = nullptr;
    SampleGrid grid;
    size_t pitch = 0;
    bool holds_edges = false;
};

// The same for such samples, not rounded, by the same rules: a position outside the frame, or one of whose samples with a weight
// above zero is not finite, becomes NaN; a whole position is its sample's bits.
void warp_samples(const SamplePlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                  float* out, size_t out_pitch);

}  // namespace ols
