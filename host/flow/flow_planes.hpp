// SPDX-License-Identifier: MIT
// How the flow solvers lay out their planes: with a border, so that neighbours need no test, and by the colours of a
// checkerboard, so that the pixels that may be relaxed together lie together.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "image/plane.hpp"

// Before a loop whose iterations do not touch each other's elements: the compiler may vectorise it without proof.
#if defined(__clang__)
#define OLS_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define OLS_INDEPENDENT _Pragma("GCC ivdep")
#endif

namespace ols {

constexpr int cache_line_floats = 16;

// Floats from row to row of `count` places that have a border and begin at a cache line.
inline int aligned_stride(int count) {
    return (count + 1 + cache_line_floats - 1) / cache_line_floats * cache_line_floats + cache_line_floats;
}

// A plane with a border of two pixels on every side. row(y) points at x = 0; y from -2 to height + 1.
struct PaddedPlane {
    static constexpr int border = 2;
    int width = 0, height = 0, stride = 0;
    std::vector<float> data;

    PaddedPlane() = default;
    PaddedPlane(int w, int h)
        : width(w), height(h), stride(w + 2 * border), data(size_t(stride) * size_t(h + 2 * border)) {}
    float* row(int y) { return data.data() + ptrdiff_t(stride) * (y + border) + border; }
    const float* row(int y) const { return data.data() + ptrdiff_t(stride) * (y + border) + border; }

    // Repeats the outermost pixels of row y into its border.
    void hold_sides(int y) {
        float* const r = row(y);
        for (int b = 1; b <= border; ++b) r[-b] = r[0], r[width - 1 + b] = r[width - 1];
    }
    // The same for the rows above and below; the sides are held before.
    void hold_ends() {
        for (int b = 1; b <= border; ++b) {
            std::copy_n(row(0) - border, stride, row(-b) - border);
            std::copy_n(row(height - 1) - border, stride, row(height - 1 + b) - border);
        }
    }
};

// A plane in two halves: pixel (x, y) has colour (x + y) & 1 and lies at x >> 1 of its colour's row y. A row has half =
// (width + 1) / 2 places (with an odd width the last of one colour is no pixel) and a border of one. So the right neighbour
// of place i is place i + p of the other colour's row, the left one i + p - 1, those above and below are place i of the other
// colour's rows, where p = first_x(color, y), the x of the row's first pixel of that colour.
struct CheckeredPlane {
    int half = 0, stride = 0, rows = 0;
    Plane data;

    CheckeredPlane() = default;
    CheckeredPlane(int width, int row_count)
        : half((width + 1) / 2),
          stride(aligned_stride(half)),
          rows(row_count),
          data(size_t(stride) * size_t(rows) * 2, 0.0f) {}
    float* row(int color, int y) {
        return data.data() + ptrdiff_t(stride) * (2 * ptrdiff_t(y) + color) + cache_line_floats;
    }
};

// The derivative along `step` elements: (1 -8 0 8 -1) / 12, exact for polynomials of degree four.
inline float derivative(const float* at, ptrdiff_t step) {
    return (8.0f / 12) * (at[step] - at[-step]) - (1.0f / 12) * (at[2 * step] - at[-2 * step]);
}

inline int first_x(int color, int y) {
    return (y + color) & 1;
}

}  // namespace ols
