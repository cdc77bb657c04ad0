// SPDX-License-Identifier: MIT
// Vignetting by pixel.
#include "render/effects/vignetting.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace ols {

std::string Vignetting::caller(const Setup& setup) const {
    if (setup.camera.vignetting == 0) return "";
    return fmt::format("camera: vignetting {:g}", setup.camera.vignetting);
}

float Vignetting::factor(float strength, int x, int y, int width, int height) {
    const float dx = x + 0.5f - width / 2.0f, dy = y + 0.5f - height / 2.0f;
    return 1 - strength * 4 * (dx * dx + dy * dy) / float(width * width + height * height);
}

void Vignetting::apply(Exposure& exposure) {
    Image& image = exposure.counts;
    tbb::parallel_for(0, image.height, [&](int y) {
        for (int x = 0; x < image.width; ++x) {
            const float f = factor(strength_, x, y, image.width, image.height);
            for (int c = 0; c < image.channels; ++c) image.at(x, y, c) *= f;
        }
    });
    count(uint64_t(image.width) * image.height);
}

}  // namespace ols
