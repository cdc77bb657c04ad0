// SPDX-License-Identifier: MIT
// From interleaved samples of either format to planes.
#include "capture/color_planes.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "reflectance/masked_sample.hpp"

namespace ols {

namespace {

constexpr int largest_short = 16383;  // warp_counts()

// The samples of one row of a frame, whatever their format.
class SampleRow {
  public:
    SampleRow(const Frame& frame, int y)
        : bytes_(frame.samples.data() + size_t(y) * frame.pitch_bytes), is_float_(frame.format == PixelFormat::f32) {}
    float at(size_t i) const {
        return is_float_ ? reinterpret_cast<const float*>(bytes_)[i]
                         : float(reinterpret_cast<const uint16_t*>(bytes_)[i]);
    }

  private:
    const std::byte* bytes_;
    bool is_float_;
};

template <typename Sample>
void load_plane(const Frame& frame, const Image& black, const ColorPlace& place,
                typename ColorPlanes<Sample>::Plane& plane) {
    const auto channels = size_t(samples_per_pixel(frame.cfa));
    const size_t step = size_t(place.step) * channels;
    const size_t first = size_t(place.first_x) * channels + size_t(place.channel);
    const auto load = [&](const auto* samples, const float* dark, Sample* out) {
        for (int x = 0; x < plane.width; ++x) {
            const size_t at = first + size_t(x) * step;
            const auto counts = float(samples[at]);
            const bool is_seen = std::isfinite(counts) && counts < frame.white;
            if constexpr (std::is_same_v<Sample, int16_t>)
                out[x] = is_seen ? Sample(int(samples[at]) - int(std::lround(dark[at]))) : masked_sample<Sample>;
            else  // 16-bit counts less whole black, floats less all of it: as row_band.cpp has it
                out[x] = !is_seen ? masked_sample<Sample>
                                  : counts - (frame.format == PixelFormat::u16 ? std::round(dark[at]) : dark[at]);
        }
    };
    for (int y = 0; y < plane.height; ++y) {
        const size_t row = size_t(place.first_y + y * place.step);
        const std::byte* bytes = frame.samples.data() + row * frame.pitch_bytes;
        const float* dark = black.data.data() + row * frame.width * channels;
        Sample* out = plane.samples.data() + size_t(y) * size_t(plane.width);
        if (frame.format == PixelFormat::u16)
            load(reinterpret_cast<const uint16_t*>(bytes), dark, out);
        else
            load(reinterpret_cast<const float*>(bytes), dark, out);
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

std::vector<ColorPlace> color_places(Cfa cfa) {
    switch (cfa) {
        case Cfa::none: return {{}};
        case Cfa::rgb: return {{0, 0, 1, 0}, {0, 0, 1, 1}, {0, 0, 1, 2}};
        default: return {{0, 0, 2, 0}, {1, 0, 2, 0}, {0, 1, 2, 0}, {1, 1, 2, 0}};
    }
}

bool fits_shorts(const Frame& frame, const Image& black) {
    const auto [least, most] = std::minmax_element(black.data.begin(), black.data.end());
    return frame.format == PixelFormat::u16 && frame.white - *least <= largest_short && *most <= largest_short;
}

template <typename Sample>
ColorPlanes<Sample> color_planes(const Frame& frame, const Image& black) {
    assert((!std::is_same_v<Sample, int16_t> || fits_shorts(frame, black)));
    ColorPlanes<Sample> out;
    for (const ColorPlace& place : color_places(frame.cfa)) {
        auto& plane = out.planes.emplace_back();
        plane.width = place.width(int(frame.width));
        plane.height = place.height(int(frame.height));
        plane.samples.resize(size_t(plane.width) * size_t(plane.height));
        load_plane<Sample>(frame, black, place, plane);
        out.any_masked = out.any_masked || std::ranges::any_of(plane.samples, is_masked<Sample>);
    }
    return out;
}

template ColorPlanes<int16_t> color_planes(const Frame&, const Image&);
template ColorPlanes<float> color_planes(const Frame&, const Image&);

Image tracking_image(const Frame& frame, const Image& black, const Image& flat) {
    const int width = int(frame.width), height = int(frame.height), channels = samples_per_pixel(frame.cfa);
    Image image(width, height, 1);
    for (int y = 0; y < height; ++y) {
        const SampleRow row(frame, y);
        for (int x = 0; x < width; ++x) {
            float sum = 0, weights = 0;
            for (int c = 0; c < channels; ++c) {
                const size_t at = size_t(x) * size_t(channels) + size_t(c);
                const float counts = row.at(at), weight = channels == 3 && c == 1 ? 2.0f : 1.0f;
                const bool is_seen = std::isfinite(counts) && counts < frame.white;
                sum += weight * (is_seen ? (counts - black.at(x, y, c)) / flat.at(x, y, c)
                                         : std::numeric_limits<float>::quiet_NaN());
                weights += weight;
            }
            image.at(x, y) = sum / weights;
        }
    }
    const bool is_mosaic = frame.cfa != Cfa::none && frame.cfa != Cfa::rgb;
    return is_mosaic ? smoothed_mosaic(image) : image;
}

Image tracking_noise(const Frame& frame, const Image& black, const Image& flat, const NoiseModel& noise) {
    const int width = int(frame.width), height = int(frame.height), channels = samples_per_pixel(frame.cfa);
    Image sigma(width, height, 1);
    if (frame.format == PixelFormat::f32) return sigma;
    for (int y = 0; y < height; ++y) {
        const SampleRow row(frame, y);
        for (int x = 0; x < width; ++x) {
            double variance = 0, weights = 0;
            for (int c = 0; c < channels; ++c) {
                const double counts = row.at(size_t(x) * size_t(channels) + size_t(c)) - black.at(x, y, c),
                             deviation = noise.read_counts + noise.shot * std::sqrt(std::max(counts, 0.0)),
                             weight = channels == 3 && c == 1 ? 2 : 1, part = weight * deviation / flat.at(x, y, c);
                variance += part * part;
                weights += weight;
            }
            sigma.at(x, y) = float(std::sqrt(variance) / weights);
        }
    }
    return sigma;
}

}  // namespace ols
