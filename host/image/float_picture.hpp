// SPDX-License-Identifier: MIT
// What the readers of OpenEXR and Radiance files hand on: linear light, and in words what was done to it on the way.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "image/frame.hpp"

namespace ols {

// The layout that a file's own header states for an environment map.
enum class StatedLayout { latitude_longitude, cube };

struct FloatPicture {
    Image
        pixels;  // 1, 3 or 4 channels (premultiplied alpha last), left to right, upright unless asked otherwise; NaN and Inf as stored
    std::vector<std::string>
        said;               // what was converted, cropped, filled or left out: a phrase each, without the file's name
    bool is_rec709 = true;  // R G B have the primaries of Rec. 709, by conversion or because nothing else was stated
    std::optional<StatedLayout> layout = std::nullopt;
    int orientation = 1;  // Exif, 1 to 8, as the file says, whether the pixels were turned or not
};

// No picture of floats is larger, whatever its file says: 32 768 x 16 384, 6.4 GB in three channels.
inline constexpr uint64_t most_pixels = uint64_t(1) << 29;

}  // namespace ols
