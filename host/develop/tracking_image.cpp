// SPDX-License-Identifier: MIT
// Row by row, in loops that the compiler vectorises: types and channels are known when compiled.
#include "develop/tracking_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace ols {

namespace {

// Of the samples of one pixel: of rgb green counts twice.
template <int channels>
constexpr float weight_of(int channel) {
    return channels == 3 && channel == 1 ? 2.0f : 1.0f;
}
template <int channels>
constexpr float weights = channels == 3 ? 4.0f : 1.0f;

template <int channels, typename Count>
void image_row(const Count* counts, const float* black, const float* flat, float white, int width, float* out) {
    for (int x = 0; x < width; ++x) {
        float sum = 0;
        for (int c = 0; c < channels; ++c) {
            const int i = x * channels + c;
            const auto value = float(counts[i]);
            const float light = (value - black[i]) / flat[i];
            const bool is_seen = value < white && value >= std::numeric_limits<float>::lowest();
            sum += weight_of<channels>(c) * (is_seen ? light : std::numeric_limits<float>::quiet_NaN());
        }
        out[x] = sum / weights<channels>;
    }
}

template <int channels>
void noise_row(const uint16_t* counts, const float* black, const float* flat, float read, float shot, int width,
               float* out) {
    for (int x = 0; x < width; ++x) {
        float variance = 0;
        for (int c = 0; c < channels; ++c) {
            const int i = x * channels + c;
            const float deviation = read + shot * std::sqrt(std::max(float(counts[i]) - black[i], 0.0f));
            const float part = weight_of<channels>(c) * deviation / flat[i];
            variance += part * part;
        }
        out[x] = std::sqrt(variance) / weights<channels>;
    }
}

template <typename Count>
const Count* row_of(const Frame& frame, int y) {
    return reinterpret_cast<const Count*>(frame.samples.data() + size_t(y) * frame.pitch_bytes);
}

template <int channels, typename Count>
void fill_image(const Frame& frame, const Image& black, const Image& flat, Image& image) {
    for (int y = 0; y < image.height; ++y) {
        const size_t at = size_t(y) * size_t(image.width) * channels;
        image_row<channels>(row_of<Count>(frame, y), &black.data[at], &flat.data[at], frame.white, image.width,
                            &image.at(0, y));
    }
}

template <int channels>
void fill_noise(const Frame& frame, const Image& black, const Image& flat, const NoiseModel& noise, Image& sigma) {
    for (int y = 0; y < sigma.height; ++y) {
        const size_t at = size_t(y) * size_t(sigma.width) * channels;
        noise_row<channels>(row_of<uint16_t>(frame, y), &black.data[at], &flat.data[at], float(noise.read_counts),
                            float(noise.shot), sigma.width, &sigma.at(0, y));
    }
}

// Mean over 3 x 3 with weights 1 2 1 across and down, edges mirrored about the outermost pixel, which keeps the mosaic's order.
Image smoothed_mosaic(const Image& image) {
    static const cv::Mat kernel = (cv::Mat_<float>(1, 3) << 0.25f, 0.5f, 0.25f);
    Image out(image.width, image.height, 1);
    const cv::Mat from(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
    cv::Mat to(image.height, image.width, CV_32F, out.data.data());
    cv::sepFilter2D(from, to, CV_32F, kernel, kernel, {-1, -1}, 0, cv::BORDER_REFLECT_101);
    return out;
}

}  // namespace

Image tracking_image(const Frame& frame, const Image& black, const Image& flat) {
    Image image(int(frame.width), int(frame.height), 1);
    const bool is_rgb = frame.cfa == Cfa::rgb;
    if (frame.format == PixelFormat::f32)
        (is_rgb ? fill_image<3, float> : fill_image<1, float>)(frame, black, flat, image);
    else
        (is_rgb ? fill_image<3, uint16_t> : fill_image<1, uint16_t>)(frame, black, flat, image);
    return frame.cfa == Cfa::none || is_rgb ? image : smoothed_mosaic(image);
}

Image tracking_noise(const Frame& frame, const Image& black, const Image& flat, const NoiseModel& noise) {
    Image sigma(int(frame.width), int(frame.height), 1);
    if (frame.format == PixelFormat::f32) return sigma;
    (frame.cfa == Cfa::rgb ? fill_noise<3> : fill_noise<1>)(frame, black, flat, noise, sigma);
    return sigma;
}

}  // namespace ols
