// SPDX-License-Identifier: MIT
// Counts above black to what the converter delivers.
#include "render/effects/quantisation.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

std::string Quantisation::caller(const Setup& setup) const {
    if (!setup.camera_model) return "";
    return fmt::format("camera: {} bits, saturates at {:g}", setup.camera.bits, setup.camera.white);
}

void Quantisation::apply(Exposure& exposure) {
    for (float& v : exposure.counts.data) v = std::clamp(std::round(v + black_), 0.0f, white_);
    count(exposure.counts.data.size());
}

}  // namespace ols
