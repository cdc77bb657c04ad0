// SPDX-License-Identifier: MIT
// What WebP files say of their colours and their orientation, which OpenImageIO 2.4 does not hand on.
#pragma once

#include <string>
#include <vector>

#include "photographs/color_label.hpp"
#include "result.hpp"

namespace ols {

struct WebpLabel {
    ColorLabel label;
    std::vector<uint8_t> exif;  // TIFF header first; empty: none
};

// ICCP and EXIF chunks of a WebP file (RFC 9649, 2.7.1). Errors: damaged.
Result<WebpLabel> read_webp_label(const std::string& path);

}  // namespace ols
