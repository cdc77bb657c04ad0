// SPDX-License-Identifier: MIT
// Three colours at every pixel of a mosaic, by a linear filter, so that demosaicing a sum of images is the sum of the
// demosaiced images: OLAT images stay mosaics and a relit mosaic is demosaiced once.
#pragma once

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

// An error where a picture is a mosaic and too small to hold all its colours.
Status check_mosaic_size(Cfa cfa, int width, int height);

// Turns one channel of at least 2 x 2 pixels with one of the four Bayer patterns into three channels. Values of any sign and size pass; the
// colour that a pixel was seen in stays as it was. Borders are mirrored about the outermost pixel, which keeps the
// pattern.
//
// Method: Malvar, He, Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images",
// ICASSP 2004, the 5 x 5 filters of figure 2.
Image demosaic(const Image& mosaic, Cfa cfa);

// Three channels of whatever a camera made: a mosaic is demosaiced, one channel repeated, three passed on.
Image as_rgb(const Image& image, Cfa cfa);

}  // namespace ols
