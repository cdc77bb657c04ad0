// SPDX-License-Identifier: MIT
// PNG previews to look at.
#pragma once

#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

// Writes 1 or 3 linear channels times `gain` as 8-bit PNG with the sRGB curve (IEC 61966-2-1), clipped at 1.
Status write_preview(const std::string& path, const Image& image, float gain);

// The gain that puts the brightest half percent of the samples that are not zero at 0.9; 1 for a black picture.
float preview_gain(const Image& image);

}  // namespace ols
