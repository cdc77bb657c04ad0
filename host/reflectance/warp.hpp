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

// Where the target's pixels are found in the slots between two tracking frames (Wenger section 6, figure 7): at position +
// base + fraction * step, with base the long-range flow from the target to the tracking frame nearer to it, and step the local
// flow from there to the other one, both as vectors of the target's pixels. Made once for all slots of the group.
//
// Flow is smooth nearly everywhere: eight pixels of a row whose vectors stay within `tolerance_px` of a straight line count as
// lying on it, which takes half of the work. Others, at edges of depth mostly, keep their own vectors. 0 keeps all.
class GroupMotion {
  public:
    GroupMotion(FlowField base, FlowField step, float tolerance_px = 0.02f);

    int width() const { return base_.width; }
    int height() const { return base_.height; }
    const FlowField& base() const { return base_; }
    const FlowField& step() const { return step_; }

    static constexpr int run_pixels = 8;
    int runs() const { return base_.width / run_pixels; }  // whole ones of a row

    // Of each run, row by row: the first pixel's vector and its change from pixel to pixel; NaN where it is no line.
    struct Lines {
        std::vector<float> base_u, base_du, base_v, base_dv, step_u, step_du, step_v, step_dv;
    };
    const Lines& lines() const { return lines_; }
    double linear_share() const;  // of the runs

    // Where the pixels of row y are found at a fraction of the step, in the source's pixels; width() values each.
    void positions(int y, float fraction, float* x_out, float* y_out) const;

  private:
    FlowField base_, step_;
    Lines lines_;
};

// The step as the target sees it: local flow at position + base.
FlowField seen_from_target(const FlowField& base, const FlowField& local);

// A flow for every second pixel of every second row, beginning at (first_x, first_y), in units of that plane's pixels: what
// one colour of a mosaic needs.
FlowField of_color_plane(const FlowField& flow, int first_x, int first_y);

struct RowRange {
    int first = 0, count = 0;
};

// The rows of `range` of the slot at a fraction of the group's step: 0 at the tracking frame nearer to the target.
// out[(y - range.first) * out_pitch + x] = the bilinear mean of the four counts around the position, rounded. A position outside the plane, or one of whose counts with a
// weight above zero is masked, is masked. |counts| <= 16383; up to 4095 interpolation keeps two more bits. Integer arithmetic
// but for the position: the same bits on every SIMD path and for any range. The position is within 2^-10 pixels of the line where it is on one.
void warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                 int16_t* out, size_t out_pitch);
// All rows.
void warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, int16_t* out, size_t out_pitch);

// One plane of samples of a source that does not quantise: NaN where there is none. Pitch in samples.
struct SamplePlane {
    const float* samples = nullptr;
    int width = 0, height = 0;
    size_t pitch = 0;
};

// The same for such samples, not rounded, by the same rules: a position outside the plane, or one of whose samples with a weight
// above zero is not finite, becomes NaN; a whole position is its sample's bits.
void warp_samples(const SamplePlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                  float* out, size_t out_pitch);

}  // namespace ols
