// SPDX-License-Identifier: MIT
// Slopes against noise, and distances to the nearest that is above.
#include "flow/evenness.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "flow/flow.hpp"

namespace ols {

namespace {

constexpr double blur = 2;  // pixels
// White noise of deviation 1 through a Gaussian, and through its derivative.
const double mean_noise = 1 / (2 * blur * std::sqrt(M_PI)), slope_noise = 1 / (blur * blur * std::sqrt(8 * M_PI));
constexpr double significant_slope = 6, significant_difference = 4;
constexpr float beyond_texture = 8;  // pixels: hollows of what flow can follow are narrower

cv::Mat mat_of(const Image& image) {
    return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
}

Image blurred(const Image& image) {
    Image out(image.width, image.height, 1);
    cv::Mat target = mat_of(out);
    cv::GaussianBlur(mat_of(image), target, {0, 0}, blur, blur, cv::BORDER_REFLECT);
    return out;
}

// 0 where something shows, else 1.
cv::Mat even_pixels(const Image& image, const Evenness& evenness) {
    cv::Mat even(image.height, image.width, CV_8U), slope_x, slope_y;
    const cv::Mat halves = (cv::Mat_<float>(1, 3) << -0.5f, 0, 0.5f), one = cv::Mat::ones(1, 1, CV_32F);
    cv::sepFilter2D(mat_of(evenness.mean), slope_x, CV_32F, halves, one, {-1, -1}, 0, cv::BORDER_REFLECT);
    cv::sepFilter2D(mat_of(evenness.mean), slope_y, CV_32F, one, halves, {-1, -1}, 0, cv::BORDER_REFLECT);
    const auto least = float(significant_slope * slope_noise / mean_noise);  // of the mean's noise
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const bool shows =
                std::hypot(slope_x.at<float>(y, x), slope_y.at<float>(y, x)) > least * evenness.noise.at(x, y);
            even.at<uint8_t>(y, x) = !shows && std::isfinite(image.at(x, y));
        }
    return even;
}

}  // namespace

Evenness evenness_of(const Image& image, const Image& sigma) {
    assert(image.channels == 1 && sigma.channels == 1 && image.width == sigma.width && image.height == sigma.height);
    Image seen = image, noise = sigma;
    for (Image* plane : {&seen, &noise})
        for (float& v : plane->data) v = std::isfinite(v) ? v : 0.0f;
    Evenness evenness{blurred(seen), blurred(noise), Image(image.width, image.height, 1)};
    // Reflected at the border, pixels count twice: up to twice the variance for either direction.
    const auto doubled = [](int at, int side) { return std::min(at, side - 1 - at) < 3 * blur ? M_SQRT2 : 1.0; };
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            evenness.noise.at(x, y) *= float(mean_noise * doubled(x, image.width) * doubled(y, image.height));
    const cv::Mat even = even_pixels(image, evenness);
    cv::Mat reach = mat_of(evenness.reach);
    cv::distanceTransform(even, reach, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
    const float diagonal = std::hypot(float(image.width), float(image.height));
    for (float& v : evenness.reach.data) v = std::min(v, diagonal);
    return evenness;
}

Image without_even_parts(const Image& image, const Evenness& evenness) {
    Image out = image;
    for (size_t p = 0; p < out.data.size(); ++p)
        if (evenness.reach.data[p] > beyond_texture) out.data[p] = std::numeric_limits<float>::quiet_NaN();
    return out;
}

std::vector<float> confidence(const FlowField& forward, const FlowField& backward, const Evenness& from,
                              const Evenness& to) {
    const FlowField round_trip = concatenated(forward, backward);
    std::vector<float> out = confidence_of(forward, round_trip);
    for (int y = 0; y < forward.height; ++y)
        for (int x = 0; x < forward.width; ++x) {
            const size_t at = size_t(y) * size_t(forward.width) + size_t(x);
            if (from.reach.data[at] == 0) continue;
            const float tx = float(x) + forward.u[at], ty = float(y) + forward.v[at];
            // What leads outside is held at the edge.
            const float hx = std::clamp(tx, 0.0f, float(forward.width - 1)),
                        hy = std::clamp(ty, 0.0f, float(forward.height - 1));
            const float miss_x = round_trip.u[at] + hx - tx, miss_y = round_trip.v[at] + hy - ty;
            const float miss2 = miss_x * miss_x + miss_y * miss_y;
            const int there_x = int(hx + 0.5f), there_y = int(hy + 0.5f);
            const float reach = std::min(from.reach.data[at], to.reach.at(there_x, there_y)), reach2 = reach * reach;
            if (!(miss2 <= reach2) || reach == 0) continue;
            const float differ = from.mean.data[at] - to.mean.at(there_x, there_y);
            const float noise_here = from.noise.data[at], noise_there = to.noise.at(there_x, there_y);
            const float noise2 = noise_here * noise_here + noise_there * noise_there;
            if (differ * differ <= float(significant_difference * significant_difference) * noise2)
                out[at] = std::max(out[at], 1 / (1 + miss2 / reach2));
        }
    return out;
}

}  // namespace ols
