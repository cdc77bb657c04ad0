// SPDX-License-Identifier: MIT
// Ordinary pictures of any format, read to linear light.
#pragma once

#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class Transfer {
    by_type,  // integers are sRGB, floats are linear
    srgb,     // IEC 61966-2-1
    linear,
};

struct Picture {
    Image light;  // 1 or 3 channels
    bool was_srgb = false;
};

// Reads PNG, JPEG, TIFF, TGA, OpenEXR and whatever else OpenCV knows, 8 or 16 bit integers or floats, into 1 or 3 channels
// of linear light, R G B, rows top to bottom; integer full scale is 1. Alpha is left out; embedded colour profiles and
// EXIF orientation are not applied (every picture of a set is to lie on the others). Errors name the file: not there,
// not a picture, cut short, of another kind of samples.
Result<Picture> read_picture(const std::string& path, Transfer transfer);

}  // namespace ols
