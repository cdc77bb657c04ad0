// SPDX-License-Identifier: MIT
// How far one image is from another.
#pragma once

#include "image/frame.hpp"

namespace ols {

struct ImageDifference {
    double peak = 0;           // what the PSNR is relative to
    double rms = 0;            // root of the mean square error over all pixels and channels
    double psnr_db = 0;        // 20 log10(peak / rms); infinite where the images are equal
    double max_error = 0;      // largest absolute difference
    double mean_relative = 0;  // sum of absolute differences over the sum of absolute reference values
    double bias_relative = 0;  // sum of signed differences over the sum of absolute reference values
};

// Compares images of the same size and number of channels, the first three of them (alpha is not light). `peak` <= 0
// takes the reference's maximum. NaN in either image makes every figure NaN.
ImageDifference image_difference(const Image& image, const Image& reference, double peak = 0);

}  // namespace ols
