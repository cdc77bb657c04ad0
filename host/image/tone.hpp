// SPDX-License-Identifier: MIT
// From scene-linear values to what a screen shows.
#pragma once

#include <cstdint>
#include <vector>

#include "image/frame.hpp"

namespace ols {

// The preview's tone curve, for each channel: x up to 0.6, then a shoulder that nears 1 without a kink,
// 0.6 + 0.4 (1 - exp(-(x - 0.6) / 0.4)). Below 0 it is 0; NaN shows as 0.
float tone_curve(float scene_linear);

// IEC 61966-2-1 (sRGB): display-linear 0..1 to code value 0..1, and back.
float srgb_encode(float linear);
float srgb_decode(float code);

// 1, 3 or 4 (premultiplied, shown over black) channels to interleaved 8-bit sRGB: tone curve, sRGB, rounding. One
// channel becomes grey.
std::vector<uint8_t> tone_mapped_rgb8(const Image& scene_linear);

// The words of the help texts.
inline constexpr const char* tone_curve_text =
    "x to 0.6, then 0.6 + 0.4 (1 - exp(-(x - 0.6) / 0.4)), each channel; sRGB, 8 bits";

}  // namespace ols
