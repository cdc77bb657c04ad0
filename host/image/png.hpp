// SPDX-License-Identifier: MIT
// PNG files of 8-bit sRGB pixels, for looking at.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

// Writes interleaved R G B, rows top to bottom, as a whole file (image/whole_file.hpp).
Status write_png(const std::string& path, int width, int height, std::span<const uint8_t> rgb8);

// A scene-linear image through tone_mapped_rgb8 (image/tone.hpp), as the bytes of a file.
Result<std::vector<uint8_t>> encode_png_preview(const Image& scene_linear);

// Writes a scene-linear image through tone_mapped_rgb8 (image/tone.hpp).
Status write_png_preview(const std::string& path, const Image& scene_linear);

}  // namespace ols
