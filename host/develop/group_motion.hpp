// SPDX-License-Identifier: MIT
// Group motion: where a target's pixels are found in the slots between two tracking frames, ready to warp each of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "flow/flow_field.hpp"

namespace ols {

// The frame that is warped: samples of one colour lie `step` columns and `step` rows apart, 2 in a mosaic.
struct SampleGrid {
    int width = 0, height = 0;
    int step = 1;

    bool operator==(const SampleGrid&) const = default;
};

// Where the target's pixels are found in the slots between two tracking frames (Wenger section 6, figure 7): at position +
// base + fraction * step, with base the long-range flow from the target to the tracking frame nearer to it, and step the local
// flow from there to the other one, both as vectors of the target's pixels. Made once for all slots of the group.
//
// Vectors are in steps of the grid: that is what shifts samples to others of their colour.
//
// Flow is smooth nearly everywhere: sixteen samples of a row, of which base and step each stay within half of `tolerance_steps`
// (in steps, too) of a straight line, count as lying on it; they take a third of the time to warp. Others, at edges of depth
// mostly, keep their own vectors. 0 keeps all.
class GroupMotion {
  public:
    static constexpr int run_samples = 16;
    static constexpr float default_tolerance = 0.1f;

    // Vectors of every pixel.
    GroupMotion(const FlowField& base, const FlowField& step, float tolerance_steps = default_tolerance);

    // Of flow at the frame's resolution or lower; vectors are in the fields' own pixels. In between they are bilinear (edges
    // held), a row at a time, where the frame is 1, 2 or 4 times as large as the fields; fields of another size are
    // enlarged first. `base` and `step` are of one size.
    GroupMotion(const FlowField& base, const FlowField& step, const SampleGrid& grid,
                float tolerance_steps = default_tolerance);

    const SampleGrid& grid() const { return grid_; }
    int runs() const { return runs_; }  // of a row; the last one of a width that is no multiple overlaps the one before
    int first_of(int run) const { return std::max(0, std::min(run * run_samples, grid_.width - run_samples)); }
    double linear_share() const;  // of the runs

    // Of each run, row by row: the first sample's vector and its change from sample to sample; NaN (base_u) where it is no line. 16
    // more values may be read.
    struct Lines {
        std::vector<float> base_u, base_du, base_v, base_dv, step_u, step_du, step_v, step_dv;
    };
    const Lines& lines() const { return lines_; }

    // Of a run's samples, where it is no line: base u, base v, step u, step v. Null where it is one.
    struct OwnVectors {
        float of[4][run_samples];
    };
    const OwnVectors* own_vectors(int run, int y) const {
        const int32_t index = own_index_[size_t(y) * size_t(runs_) + size_t(run)];
        return index < 0 ? nullptr : &own_[size_t(index)];
    }

    // Sets marks[y * grid().width + x] to 1 for the samples of every run that does not lie on a line along which nothing moves,
    // at any fraction of the step; the others stay.
    void mark_moving(std::span<uint8_t> marks) const;

    // The vectors of row y at a fraction of the step: grid().width values each.
    void vectors(int y, float fraction, float* u_out, float* v_out) const;

  private:
    void make(const FlowField& base, const FlowField& step, float tolerance_steps);
    bool is_still(size_t run) const;  // counted over all rows
    void keep_own(const float* const (&rows)[4], int y, const std::vector<uint8_t>& is_line);

    SampleGrid grid_;
    int runs_ = 0;
    Lines lines_;
    std::vector<OwnVectors> own_;
    std::vector<int32_t> own_index_;  // of each run; -1 for a line
};

}  // namespace ols
