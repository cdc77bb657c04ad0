// SPDX-License-Identifier: MIT
// Error figures between two images.
#include "image/compare.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace ols {

ImageDifference image_difference(const Image& image, const Image& reference, double peak) {
    const int channels = std::min(image.channels, 3);
    assert(image.width == reference.width && image.height == reference.height &&
           channels == std::min(reference.channels, 3));
    double squares = 0, absolute = 0, signed_sum = 0, reference_sum = 0, largest = 0, maximum = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            for (int c = 0; c < channels; ++c) {
                const double truth = reference.at(x, y, c), error = image.at(x, y, c) - truth;
                squares += error * error;
                absolute += std::abs(error);
                signed_sum += error;
                reference_sum += std::abs(truth);
                largest = std::max(largest, std::abs(error));
                maximum = std::max(maximum, truth);
            }
        }
    }
    if (std::isnan(squares)) largest = maximum = std::numeric_limits<double>::quiet_NaN();
    ImageDifference difference;
    difference.peak = peak > 0 ? peak : maximum;
    difference.rms = std::sqrt(squares / (double(image.width) * image.height * channels));
    difference.psnr_db = 20 * std::log10(difference.peak / difference.rms);
    difference.max_error = largest;
    difference.mean_relative = absolute / reference_sum;
    difference.bias_relative = signed_sum / reference_sum;
    return difference;
}

}  // namespace ols
