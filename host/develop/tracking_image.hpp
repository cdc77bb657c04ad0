// SPDX-License-Identifier: MIT
// Tracking image: what motion is found in, and how noisy it is.
#pragma once

#include "image/frame.hpp"
#include "stage/stage.hpp"

namespace ols {

// One channel of counts above black over the flat, so that every pixel of a mosaic counts alike: each is the mean over its
// neighbourhood of 3 x 3 with weights 1 2 1, in which a quarter is red, a half green, a quarter blue wherever it lies.
// Monochrome frames pass unsmoothed, rgb becomes (R + 2 G + B) / 4. NaN where a sample of it is saturated or not finite.
Image tracking_image(const Frame& frame, const Image& black, const Image& flat);

// The standard deviation of its noise: that of independent samples, even where a mosaic's are smoothed (noise that is averaged
// over several pixels comes out the same, but for the smoothing's own width). 0 for frames of floats, which come from a camera
// without noise.
Image tracking_noise(const Frame& frame, const Image& black, const Image& flat, const NoiseModel& noise);

}  // namespace ols
