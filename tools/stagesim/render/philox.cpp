// SPDX-License-Identifier: MIT
// Random words to normal samples.
#include "render/philox.hpp"

#include <cmath>
#include <numbers>

namespace ols {

std::array<float, 4> standard_normals(const std::array<uint32_t, 4>& words) {
    std::array<float, 4> normals;
    for (int pair = 0; pair < 2; ++pair) {
        // (0, 1], so that the logarithm is finite; 24 bits reach 5.8 sigma.
        const float u = (float(words[2 * pair] >> 8) + 1) * 0x1p-24f;
        const float angle = float(words[2 * pair + 1] >> 8) * (0x1p-23f * std::numbers::pi_v<float>);
        const float radius = std::sqrt(-2 * std::log(u));
        normals[2 * pair] = radius * std::cos(angle);
        normals[2 * pair + 1] = radius * std::sin(angle);
    }
    return normals;
}

}  // namespace ols
