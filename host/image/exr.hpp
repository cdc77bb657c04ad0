// SPDX-License-Identifier: MIT
// OpenEXR files of one part with 1, 3 or 4 channels: environment maps, flat fields, relit pictures.
// Archives (many parts, many lamp layers) are host/archive.
#pragma once

#include <map>
#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class ExrType { half_float, single_float };

// Reads R G B [A] or Y (or any single channel) of a one-part scanline or tiled file into 3, 4 or 1 channels, rows top
// to bottom, the data window's size. Errors name the file and what is wrong with it. Values are as stored: NaN and Inf
// are the caller's to judge.
Result<Image> read_exr(const std::string& path);

// Whether a file's `envmap` attribute says that it is a cube map. False without the attribute.
Result<bool> is_exr_cube_map(const std::string& path);

// Writes 1 (Y), 3 (R G B) or 4 (R G B A, premultiplied) channels, ZIP compressed, scene-linear, as a whole file
// (image/whole_file.hpp). `attributes` are string attributes of the header; a
// colorInteropID of lin_rec709_scene brings the chromaticities with it.
Status write_exr(const std::string& path, const Image& image, ExrType type = ExrType::half_float,
                 const std::map<std::string, std::string>& attributes = {});

}  // namespace ols
