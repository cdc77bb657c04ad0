// SPDX-License-Identifier: MIT
// Colour planes: a frame's samples above black, each colour of a mosaic by itself, so that they can be interpolated.
#pragma once

#include <vector>

#include "image/frame.hpp"
#include "reflectance/warp.hpp"
#include "stage/stage.hpp"

namespace ols {

// One sample in every step-th column and row of the frame, from (first_x, first_y) on: what one colour of a mosaic sees.
// `channel` of the samples of a pixel.
struct ColorPlace {
    int first_x = 0, first_y = 0, step = 1, channel = 0;

    int width(int frame_width) const { return (frame_width - first_x + step - 1) / step; }
    int height(int frame_height) const { return (frame_height - first_y + step - 1) / step; }
};

// Four places of a mosaic, three of rgb, one of monochrome.
std::vector<ColorPlace> color_places(Cfa cfa);

// Sample: int16_t, for cameras whose white lies at most 16383 counts above black, or float.
template <typename Sample>
struct ColorPlanes {
    struct Plane {
        int width = 0, height = 0;
        std::vector<Sample> samples;  // row by row, counts above the whole part of black
    };
    std::vector<Plane> planes;  // by color_places()
    bool any_masked = false;
    std::vector<Plane> clipped;  // where any is masked: the same, but what saturated is there, a lower bound
    int largest = 0;             // |sample| at most, of cameras that count
};

// Whether counts up to `white` above this black fit ColorPlanes<int16_t>.
bool fits_shorts(PixelFormat format, float white, const Image& black);

// What is taken off the samples: of a camera that counts the whole part of black (row_band.hpp), else all of it.
template <typename Sample>
ColorPlanes<Sample> black_planes(const Image& black, Cfa cfa, PixelFormat format);

// Samples less `black`, masked_sample<Sample> where one is at or above white or not finite. int16_t only where
// fits_shorts().
template <typename Sample>
ColorPlanes<Sample> color_planes(const Frame& frame, const ColorPlanes<Sample>& black);

// What motion is found in: one channel of counts above black over the flat, so that every pixel of a mosaic counts alike:
// each is the mean over its neighbourhood of 3 x 3 with weights 1 2 1, in which a quarter is red, a half green, a quarter
// blue wherever it lies. Monochrome frames pass unsmoothed, rgb becomes (R + 2 G + B) / 4. NaN where a sample of it is
// saturated or not finite.
Image tracking_image(const Frame& frame, const Image& black, const Image& flat);

// The standard deviation of its noise: that of independent samples, even where a mosaic's are smoothed (noise that is averaged
// over several pixels comes out the same, but for the smoothing's own width). 0 for frames of floats, which come from a camera
// without noise.
Image tracking_noise(const Frame& frame, const Image& black, const Image& flat, const NoiseModel& noise);

}  // namespace ols
