// SPDX-License-Identifier: MIT
// Group motion: where a target's pixels are found in the slots between two tracking frames, ready to warp each of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "reflectance/flow_field.hpp"

namespace ols {

// Which pixels of a frame a plane has: its (x, y) is the frame's (first_x + step x, first_y + step y). A colour of a mosaic has
// step 2.
struct PlaneGrid {
    int frame_width = 0, frame_height = 0;
    int step = 1, first_x = 0, first_y = 0;

    int width() const { return (frame_width - first_x + step - 1) / step; }
    int height() const { return (frame_height - first_y + step - 1) / step; }
};

// Where the target's pixels are found in the slots between two tracking frames (Wenger section 6, figure 7): at position +
// base + fraction * step, with base the long-range flow from the target to the tracking frame nearer to it, and step the local
// flow from there to the other one, both as vectors of the target's pixels. Made once for all slots of the group.
//
// Flow is smooth nearly everywhere: eight pixels of a row, of which base and step each stay within half of `tolerance_px` of a
// straight line, count as lying on it; they take a third of the time to warp. Others, at edges of depth mostly, keep their own
// vectors. 0 keeps all.
class GroupMotion {
  public:
    static constexpr int run_pixels = 8;

    // Vectors of every pixel of a plane, in that plane's pixels.
    GroupMotion(const FlowField& base, const FlowField& step, float tolerance_px = 0.02f);

    // For a plane of a frame, of flow at the frame's resolution or lower; vectors are in the fields' own pixels. In between they
    // are bilinear (edges held), a row at a time, where the frame is 1, 2 or 4 times as large as the fields; fields of
    // another size are enlarged first. `base` and `step` are of one size.
    GroupMotion(const FlowField& base, const FlowField& step, const PlaneGrid& grid, float tolerance_px = 0.02f);

    int width() const { return width_; }
    int height() const { return height_; }
    int runs() const { return runs_; }  // of a row; the last one of a width that is no multiple overlaps the one before
    int first_of(int run) const { return std::max(0, std::min(run * run_pixels, width_ - run_pixels)); }
    double linear_share() const;  // of the runs

    // Of each run, row by row: the first pixel's vector and its change from pixel to pixel; NaN (base_u) where it is no line. 16
    // more values may be read.
    struct Lines {
        std::vector<float> base_u, base_du, base_v, base_dv, step_u, step_du, step_v, step_dv;
    };
    const Lines& lines() const { return lines_; }

    // Of a run's pixels, where it is no line: base u, base v, step u, step v. Null where it is one.
    struct OwnVectors {
        float of[4][run_pixels];
    };
    const OwnVectors* own_vectors(int run, int y) const {
        const int32_t index = own_index_[size_t(y) * size_t(runs_) + size_t(run)];
        return index < 0 ? nullptr : &own_[size_t(index)];
    }

    // Where the pixels of row y are found at a fraction of the step, in the source's pixels: width() values each.
    void positions(int y, float fraction, float* x_out, float* y_out) const;

  private:
    void make(const FlowField& base, const FlowField& step, const PlaneGrid& grid, float tolerance_px);
    void keep_own(const float* const (&rows)[4], int y, const std::vector<uint8_t>& is_line);

    int width_ = 0, height_ = 0, runs_ = 0;
    Lines lines_;
    std::vector<OwnVectors> own_;
    std::vector<int32_t> own_index_;  // of each run; -1 for a line
};

}  // namespace ols
