// SPDX-License-Identifier: MIT
// Truevision TGA pictures, which OpenCV does not read.
#pragma once

#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

// Reads true-colour (24 or 32 bits; alpha is left out) and grey (8 bits) files, plain or run-length encoded, from any of
// the four corners: 3 or 1 channels of code values 0..255, rows top to bottom. Source: "Truevision TGA File Format
// Specification", version 2.0. Errors name the file: cut short, colour-mapped or of another depth.
Result<Image> read_tga(const std::string& path);

}  // namespace ols
