// SPDX-License-Identifier: MIT
// Luminance and chroma (Y RY BY) to R G B. RY = (R - Y) / Y, BY = (B - Y) / Y.
#pragma once

#include <array>

#include "image/frame.hpp"

namespace ols {

// Chroma (two channels) at every second column and row, interpolated to all of them by the OpenEXR library's own filter
// (ImfRgbaYca.h), in half floats. What lies beyond the border is like the last sample before it.
Image full_chroma(const Image& halved);

// Replaces Y, RY, BY in the first three channels by R, G, B; `weights` are the shares of R, G, B in Y. What the library calls
// fixSaturation() is left out: colours at hard edges may ring below 0.
void chroma_to_rgb(Image& ycc, const std::array<double, 3>& weights);

}  // namespace ols
