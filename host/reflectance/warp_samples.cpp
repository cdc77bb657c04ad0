// SPDX-License-Identifier: MIT
// The warp of samples that no camera has quantised: plain bilinear interpolation in float.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "reflectance/masked_sample.hpp"
#include "reflectance/warp.hpp"

namespace ols {

namespace {

// Exact, down to the sign of zero, where the weight is 0 and b is a.
float lerp(float a, float b, float weight) {
    return (1 - weight) * a + weight * b;
}

float sample_at(const SamplePlane& source, float x, float y) {
    if (source.holds_edges && !std::isnan(x) && !std::isnan(y)) {
        x = std::clamp(x, 0.0f, float(source.width - 1));
        y = std::clamp(y, 0.0f, float(source.height - 1));
    }
    if (!(x >= 0 && y >= 0 && x <= float(source.width - 1) && y <= float(source.height - 1)))
        return masked_sample<float>;
    const int left = int(x), above = int(y);
    const float fx = x - float(left), fy = y - float(above);
    // A neighbour without weight is not read: it may be masked, or outside.
    const size_t right = fx > 0 ? 1 : 0, below = fy > 0 ? source.pitch : 0;
    const float* const at = source.samples + size_t(above) * source.pitch + size_t(left);
    return lerp(lerp(at[0], at[right], fx), lerp(at[below], at[below + right], fx), fy);
}

}  // namespace

void warp_samples(const SamplePlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                  float* out, size_t out_pitch) {
    assert(source.samples && motion.width() == source.width && motion.height() == source.height);
    assert(range.first >= 0 && range.count >= 0 && range.first + range.count <= source.height);
    std::vector<float> at_x(size_t(source.width)), at_y(size_t(source.width));
    for (int row = 0; row < range.count; ++row) {
        motion.positions(range.first + row, fraction, at_x.data(), at_y.data());
        float* const to = out + size_t(row) * out_pitch;
        for (size_t x = 0; x < at_x.size(); ++x) {
            const float value = sample_at(source, at_x[x], at_y[x]);
            to[x] = std::isfinite(value) ? value : masked_sample<float>;
        }
    }
}

}  // namespace ols
