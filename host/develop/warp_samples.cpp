// SPDX-License-Identifier: MIT
// The warp of samples that no camera has quantised: plain bilinear interpolation in float.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "demultiplex/masked_sample.hpp"
#include "develop/warp.hpp"

namespace ols {

namespace {

// Exact, down to the sign of zero, where the weight is 0 and b is a.
float lerp(float a, float b, float weight) {
    return (1 - weight) * a + weight * b;
}

// Samples of one colour in a row or column: which one a coordinate lies at, in steps, and how many there are.
struct Steps {
    float at;
    int count;
};

Steps steps_of(int coordinate, int size, int step) {
    const int color = coordinate % step;
    return {float(coordinate / step), (size - color + step - 1) / step};
}

float sample_at(const SamplePlane& source, int x, int y, float u, float v) {
    const int step = source.grid.step;
    const Steps across = steps_of(x, source.grid.width, step), down = steps_of(y, source.grid.height, step);
    const float last_x = float(across.count - 1), last_y = float(down.count - 1);
    float at_x = across.at + u, at_y = down.at + v;
    if (source.holds_edges && !std::isnan(at_x) && !std::isnan(at_y)) {
        at_x = std::clamp(at_x, 0.0f, last_x);
        at_y = std::clamp(at_y, 0.0f, last_y);
    }
    if (!(at_x >= 0 && at_y >= 0 && at_x <= last_x && at_y <= last_y)) return masked_sample<float>;
    const float fx = at_x - std::floor(at_x), fy = at_y - std::floor(at_y);
    const size_t left = size_t(int(at_x) * step + x % step), above = size_t(int(at_y) * step + y % step);
    // A neighbour without weight is not read: it may be masked, or outside.
    const size_t right = fx > 0 ? size_t(step) : 0, below = fy > 0 ? source.pitch * size_t(step) : 0;
    const float* const at = source.samples + above * source.pitch + left;
    return lerp(lerp(at[0], at[right], fx), lerp(at[below], at[below + right], fx), fy);
}

}  // namespace

void warp_samples(const SamplePlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                  float* out, size_t out_pitch) {
    assert(source.samples && motion.grid() == source.grid);
    assert(range.first >= 0 && range.count >= 0 && range.first + range.count <= source.grid.height);
    std::vector<float> u(size_t(source.grid.width)), v(size_t(source.grid.width));
    for (int row = 0; row < range.count; ++row) {
        motion.vectors(range.first + row, fraction, u.data(), v.data());
        float* const to = out + size_t(row) * out_pitch;
        for (size_t x = 0; x < u.size(); ++x) {
            const float value = sample_at(source, int(x), range.first + row, u[x], v[x]);
            to[x] = std::isfinite(value) ? value : masked_sample<float>;
        }
    }
}

}  // namespace ols
