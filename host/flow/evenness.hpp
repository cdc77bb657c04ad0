// SPDX-License-Identifier: MIT
// Evenness: where an image shows nothing above its noise. Flow has nothing to go by there, and none is needed.
#pragma once

#include <vector>

#include "image/flow_field.hpp"
#include "image/frame.hpp"

namespace ols {

struct Evenness {
    Image mean;   // the image through a Gaussian of two pixels
    Image noise;  // the standard deviation of `mean`
    // Pixels to the nearest one that shows something: whose slope, through the same Gaussian, is above six standard deviations
    // of what noise makes of it either way (one pixel in 65 million of noise alone), or that was not seen. The image's diagonal
    // where there is none.
    Image reach;
};

// `sigma`: the standard deviation of each pixel's noise, in the image's unit. One channel each, of one size; NaN where nothing
// was seen.
Evenness evenness_of(const Image& image, const Image& sigma);

// NaN for the pixels of an image that are more than eight pixels from anything: a flow is not to read their noise.
Image without_even_parts(const Image& image, const Evenness& evenness);

// confidence() of flow.hpp where the images show something; where a pixel's surroundings are even in both, a miss does no
// harm: with `reach` the lesser of the two, at the pixel and where it leads, of pixels that look the same (means within four
// standard deviations of their difference), it is 1 / (1 + (miss / reach)^2), if that is more and miss <= reach.
//
// A pixel that gets covered is not trusted by that, even by something as bright, as long as its outline shows: from the
// pixel to the outline before and from where the pixel was to the outline after, it is the outline's motion at most, which
// is what the pixel misses itself by. The lesser way of the two is half of that at most.
std::vector<float> confidence(const FlowField& forward, const FlowField& backward, const Evenness& from,
                              const Evenness& to);

}  // namespace ols
