// SPDX-License-Identifier: MIT
// The sRGB curve, and OpenCV's PNG writer.
#include "preview.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

namespace ols {

namespace {

uint8_t srgb(float v) {
    v = std::clamp(v, 0.0f, 1.0f);
    const float coded = v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
    return uint8_t(std::lround(255 * coded));
}

}  // namespace

Status write_preview(const std::string& path, const Image& image, float gain) {
    cv::Mat png(image.height, image.width, CV_8UC3);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < 3; ++c)  // OpenCV stores blue first
                png.at<cv::Vec3b>(y, x)[2 - c] = srgb(gain * image.at(x, y, image.channels == 3 ? c : 0));
    try {
        if (cv::imwrite(path, png)) return Done{};
    } catch (const cv::Exception&) {
    }
    return fail("cannot write '" + path + "': the name must end in .png and its folder must exist");
}

float preview_gain(const Image& image) {
    std::vector<float> samples;
    for (const float v : image.data)
        if (v > 0) samples.push_back(v);
    if (samples.empty()) return 1;
    const auto place = samples.begin() + std::ptrdiff_t(double(samples.size() - 1) * 0.995);
    std::nth_element(samples.begin(), place, samples.end());
    return 0.9f / *place;
}

}  // namespace ols
