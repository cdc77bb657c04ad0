// SPDX-License-Identifier: MIT
// The preview's tone curve and the sRGB transfer function.
#include "image/tone.hpp"

#include <algorithm>
#include <cmath>

namespace ols {

float tone_curve(float x) {
    constexpr float knee = 0.6f, room = 1 - knee;
    if (!(x > 0)) return 0;
    return x <= knee ? x : knee + room * (1 - std::exp((knee - x) / room));
}

float srgb_encode(float linear) {
    if (linear <= 0.0031308f) return 12.92f * linear;
    return 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float srgb_decode(float code) {
    if (code <= 0.04045f) return code / 12.92f;
    return std::pow((code + 0.055f) / 1.055f, 2.4f);
}

std::vector<uint8_t> tone_mapped_rgb8(const Image& image) {
    std::vector<uint8_t> rgb;
    rgb.reserve(size_t(image.width) * image.height * 3);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            for (int c = 0; c < 3; ++c) {
                const float shown = srgb_encode(tone_curve(image.at(x, y, image.channels >= 3 ? c : 0)));
                rgb.push_back(uint8_t(std::lround(255 * std::clamp(shown, 0.0f, 1.0f))));
            }
        }
    }
    return rgb;
}

}  // namespace ols
