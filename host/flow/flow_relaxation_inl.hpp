// SPDX-License-Identifier: MIT
// The linear solver of the variational flows, compiled once for each vector path: red-black over-relaxation of coupled 2 x 2
// systems, all sweeps of a reweighting in one pass over the image. Included by the files that add a data term.
//
// At each pixel: (A + sum of edges e) w = b + sum of e w' over the four neighbours, A symmetric 2 x 2, w = (u, v). A data term
// writes A, b and the edges to the right and down, a row at a time, and the solver does the rest.
//
// Method: successive over-relaxation (Young 1954) on the checkerboard's two colours in turn. Half-sweep k of row y needs
// half-sweep k - 1 of rows y - 1 to y + 1, and nothing else: so the pass weighs row t, then does half-sweep k of row t - 1 - k
// for each k. That is the order of whole sweeps, bit for bit, but A, b and the edges live for a few rows only, and everything
// stays in the second-level cache. Loops are plain and independent, for the compiler to vectorise: no fused multiply-add, no
// reassociation, hence the same bits on every path.
#if defined(OLS_FLOW_RELAXATION_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OLS_FLOW_RELAXATION_INL
#undef OLS_FLOW_RELAXATION_INL
#else
#define OLS_FLOW_RELAXATION_INL
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "flow/flow_planes.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {

// The rows of A, b and edges that are alive, by colours as in CheckeredPlane: a ring, in which everything of an image row lies
// together, so that no two of the many rows that a loop reads fall on the same cache sets. Edges of what lies outside the
// image are zero.
class RelaxationRows {
  public:
    // a11, a12, a22, once inverted, hold (A + sum of edges)^-1.
    enum Plane { right, down, a11, a12, a22, b1, b2, planes };

    RelaxationRows(int width, int sweeps)
        : half_((width + 1) / 2),
          mask_(int(std::bit_ceil(unsigned(2 * sweeps + 2))) - 1),
          stride_(aligned_stride(half_)),
          data_(size_t(mask_ + 1) * planes * 2 * size_t(stride_), 0.0f) {}

    int half() const { return half_; }
    float* row(Plane plane, int color, int y) {
        return data_.data() + ptrdiff_t(((y & mask_) * planes + plane) * 2 + color) * stride_ + cache_line_floats;
    }

  private:
    int half_, mask_, stride_;
    ols::Plane data_;
};

// (A + E)^-1. A is positive semidefinite and E at least `floor`, so the determinant is at least floor^2: nothing is singular,
// and a pixel without data or neighbours stays at zero.
HWY_INLINE void invert_row(RelaxationRows& rows, int color, int y) {
    constexpr float floor = 1e-6f;
    const int p = first_x(color, y), n = rows.half();
    const float* HWY_RESTRICT right = rows.row(RelaxationRows::right, color, y);
    const float* HWY_RESTRICT left = rows.row(RelaxationRows::right, 1 - color, y) + p - 1;
    const float* HWY_RESTRICT down = rows.row(RelaxationRows::down, color, y);
    const float* HWY_RESTRICT up = rows.row(RelaxationRows::down, 1 - color, y - 1);
    float* HWY_RESTRICT a11 = rows.row(RelaxationRows::a11, color, y);
    float* HWY_RESTRICT a12 = rows.row(RelaxationRows::a12, color, y);
    float* HWY_RESTRICT a22 = rows.row(RelaxationRows::a22, color, y);
    OLS_INDEPENDENT
    for (int i = 0; i < n; ++i) {
        const float edges = std::max(right[i] + left[i] + down[i] + up[i], floor);
        const float m11 = a11[i], m12 = a12[i], m22 = a22[i];
        const float determinant = std::max(m11 * m22 - m12 * m12, 0.0f) + edges * (m11 + m22) + edges * edges;
        const float scale = 1 / determinant;
        a11[i] = (m22 + edges) * scale;
        a12[i] = -m12 * scale;
        a22[i] = (m11 + edges) * scale;
    }
}

// Writes 0 to the edge that leads out of the image on the right, or is below the last row.
HWY_INLINE void close_edges(RelaxationRows& rows, int width, int y, bool last) {
    rows.row(RelaxationRows::right, (width - 1 + y) & 1, y)[(width - 1) >> 1] = 0;
    if (!last) return;
    for (int color = 0; color < 2; ++color) std::fill_n(rows.row(RelaxationRows::down, color, y), rows.half(), 0.0f);
}

// Where there are no data the flow decays towards zero, and would go through denormal numbers, with which the sweeps take
// twice as long, as their squares would: adding and taking away `tiny` rounds what is below some 1e-15 pixels to zero.
HWY_INLINE void sweep_row(RelaxationRows& rows, CheckeredPlane& u_plane, CheckeredPlane& v_plane, int color, int y,
                          bool first, bool last, float relaxation) {
    constexpr float tiny = 1e-8f;
    const int p = first_x(color, y), n = rows.half();
    const int other = 1 - color, row_above = first ? y : y - 1, row_below = last ? y : y + 1;
    const float* HWY_RESTRICT right = rows.row(RelaxationRows::right, color, y);
    const float* HWY_RESTRICT left = rows.row(RelaxationRows::right, other, y) + p - 1;
    const float* HWY_RESTRICT down = rows.row(RelaxationRows::down, color, y);
    const float* HWY_RESTRICT up = rows.row(RelaxationRows::down, other, y - 1);
    const float* HWY_RESTRICT m11 = rows.row(RelaxationRows::a11, color, y);
    const float* HWY_RESTRICT m12 = rows.row(RelaxationRows::a12, color, y);
    const float* HWY_RESTRICT m22 = rows.row(RelaxationRows::a22, color, y);
    const float* HWY_RESTRICT b1 = rows.row(RelaxationRows::b1, color, y);
    const float* HWY_RESTRICT b2 = rows.row(RelaxationRows::b2, color, y);
    const float *u_side = u_plane.row(other, y) + p, *u_up = u_plane.row(other, row_above),
                *u_down = u_plane.row(other, row_below);
    const float *v_side = v_plane.row(other, y) + p, *v_up = v_plane.row(other, row_above),
                *v_down = v_plane.row(other, row_below);
    float* HWY_RESTRICT u = u_plane.row(color, y);
    float* HWY_RESTRICT v = v_plane.row(color, y);
    OLS_INDEPENDENT
    for (int i = 0; i < n; ++i) {
        const float e1 = right[i], e2 = left[i], e3 = down[i], e4 = up[i];
        const float s1 = b1[i] + e1 * u_side[i] + e2 * u_side[i - 1] + e3 * u_down[i] + e4 * u_up[i];
        const float s2 = b2[i] + e1 * v_side[i] + e2 * v_side[i - 1] + e3 * v_down[i] + e4 * v_up[i];
        u[i] = u[i] + relaxation * (m11[i] * s1 + m12[i] * s2 - u[i]) + tiny - tiny;
        v[i] = v[i] + relaxation * (m12[i] * s1 + m22[i] * s2 - v[i]) + tiny - tiny;
    }
}

// One reweighting: `term.weigh_row(rows, u, v, y)` writes A, b and edges of row y from u and v of rows y - 1 to y + 2, all
// before any sweep touches them; then `sweeps` sweeps.
template <class Term>
void relax(Term& term, CheckeredPlane& u, CheckeredPlane& v, int sweeps, float relaxation) {
    const int height = u.rows, half_sweeps = 2 * sweeps;
    RelaxationRows rows(term.width(), sweeps);  // zero, so the edges from above row 0 are
    for (int t = 0; t < height + half_sweeps; ++t) {
        if (t < height) {
            term.weigh_row(rows, u, v, t);
            for (int color = 0; color < 2; ++color) invert_row(rows, color, t);
        }
        for (int k = 0; k < half_sweeps; ++k) {
            const int y = t - 1 - k;
            if (y >= 0 && y < height) sweep_row(rows, u, v, k & 1, y, y == 0, y == height - 1, relaxation);
        }
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();
#endif
