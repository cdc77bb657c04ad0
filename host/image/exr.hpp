// SPDX-License-Identifier: MIT
// OpenEXR pictures: environment maps, photographs, flat fields, relit pictures.
// Archives (many parts, many lamp layers) are host/archive.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "image/float_picture.hpp"
#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class ExrType { half_float, single_float };

// Which of several pictures of a file is meant. Without: the only one with colour, or the unnamed layer among several.
struct ExrChoice {
    std::optional<std::string> part = std::nullopt;   // its name or number
    std::optional<std::string> layer = std::nullopt;  // "beauty" for beauty.R beauty.G beauty.B
    bool convert = true;                              // to Rec. 709, where its primaries are others
    bool turn = true;  // upright, if the file says (as OpenImageIO writes it) that its pixels lie turned or mirrored
};

// Reads R G B [A], Y [A] or Y RY BY [A] of a scanline or tiled part, at full resolution, into 1, 3 or 4 channels. The picture is
// the display window: black (alpha 0) where the data window does not reach, overscan cropped. Chromaticities other than Rec. 709
// are converted to it, white to white. Errors name the file and why: not there, no regular file, not OpenEXR, damaged or
// incomplete, several pictures to choose from, nothing that is light (deep, whole numbers, depth, normals ...), a size that the
// file cannot hold (image/exr_sizes.hpp).
Result<FloatPicture> read_exr_picture(const std::string& path, const ExrChoice& choice = {});

// The pixels alone.
Result<Image> read_exr(const std::string& path);

// Whether bytes begin as OpenEXR files do.
bool begins_as_exr(std::string_view bytes);

// Writes 1 (Y), 3 (R G B) or 4 (R G B A, premultiplied) channels, ZIP compressed, scene-linear, as a whole file
// (image/whole_file.hpp). `attributes` are string attributes of the header; a
// colorInteropID of lin_rec709_scene brings the chromaticities with it.
Status write_exr(const std::string& path, const Image& image, ExrType type = ExrType::half_float,
                 const std::map<std::string, std::string>& attributes = {});

}  // namespace ols
