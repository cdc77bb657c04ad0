// SPDX-License-Identifier: MIT
// The forward-backward check, in a loop that the compiler vectorises.
#include <cmath>

#include "flow/flow.hpp"

namespace ols {

std::vector<float> confidence_of(const FlowField& forward, const FlowField& round_trip) {
    std::vector<float> out(forward.size());
    const auto last_x = float(forward.width - 1), last_y = float(forward.height - 1);
    for (int y = 0; y < forward.height; ++y) {
        const size_t row = size_t(y) * size_t(forward.width);
        const float *const us = &forward.u[row], *const vs = &forward.v[row];
        const float *const trip_us = &round_trip.u[row], *const trip_vs = &round_trip.v[row];
        float* const to = &out[row];
        for (int x = 0; x < forward.width; ++x) {
            const float u = us[x], v = vs[x], tx = float(x) + u, ty = float(y) + v;
            const float back_u = trip_us[x] - u, back_v = trip_vs[x] - v;
            const float miss2 = trip_us[x] * trip_us[x] + trip_vs[x] * trip_vs[x];
            const float allowed =
                0.5f + 0.01f * (std::sqrt(u * u + v * v) + std::sqrt(back_u * back_u + back_v * back_v));
            const float c = 1 / (1 + miss2 / (allowed * allowed));
            // What leads outside, and NaN, is not trusted.
            const bool is_inside = (tx >= 0) & (ty >= 0) & (tx <= last_x) & (ty <= last_y) & (c >= 0);
            to[x] = is_inside ? c : 0.0f;
        }
    }
    return out;
}

std::vector<float> confidence(const FlowField& forward, const FlowField& backward) {
    return confidence_of(forward, concatenated(forward, backward));
}

}  // namespace ols
