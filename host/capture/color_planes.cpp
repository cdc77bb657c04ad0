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

// Less black, and no more than a Sample holds: without a white (`ColorPlanes::clipped`) a sensor may count up to 65535.
template <typename Sample>
Sample above_black(int counts, Sample black) {
    if constexpr (std::is_same_v<Sample, int16_t>)
        return Sample(std::min(counts - black, int(std::numeric_limits<int16_t>::max())));
    else
        return Sample(counts) - black;
}

// Every step-th of `samples`, less black, masked where it is not below white; step is known when compiled, or the loop would
// not be vectorised.
template <size_t step, typename Count, typename Sample>
void subtract_row(const Count* samples, float white, const Sample* black, int width, Sample* out) {
    if constexpr (std::is_same_v<Count, uint16_t>) {
        const auto limit = int(std::ceil(std::min(white, 65536.0f)));
        for (int x = 0; x < width; ++x) {
            const int counts = samples[size_t(x) * step];
            out[x] = counts < limit ? above_black(counts, black[x]) : masked_sample<Sample>;
        }
    } else {
        for (int x = 0; x < width; ++x) {
            const float value = samples[size_t(x) * step];
            out[x] = std::isfinite(value) && value < white ? Sample(value) - black[x] : masked_sample<Sample>;
        }
    }
}

template <typename Count, typename Sample>
void load_plane(const Frame& frame, float white, const ColorPlace& place, const std::vector<Sample>& black,
                typename ColorPlanes<Sample>::Plane& plane) {
    const auto channels = size_t(samples_per_pixel(frame.cfa));
    for (int y = 0; y < plane.height; ++y) {
        const size_t row = size_t(place.first_y + y * place.step), at = size_t(y) * size_t(plane.width);
        const auto* samples = reinterpret_cast<const Count*>(frame.samples.data() + row * frame.pitch_bytes) +
                              size_t(place.first_x) * channels + size_t(place.channel);
        const auto subtract = [&](auto step) {
            subtract_row<decltype(step)::value>(samples, white, &black[at], plane.width, &plane.samples[at]);
        };
        if (place.step == 2)
            subtract(std::integral_constant<size_t, 2>());
        else if (channels == 3)
            subtract(std::integral_constant<size_t, 3>());
        else
            subtract(std::integral_constant<size_t, 1>());
    }
}

template <typename Sample>
ColorPlanes<Sample> empty_planes(int width, int height, Cfa cfa) {
    ColorPlanes<Sample> out;
    for (const ColorPlace& place : color_places(cfa)) {
        auto& plane = out.planes.emplace_back();
        plane.width = place.width(width);
        plane.height = place.height(height);
        plane.samples.resize(size_t(plane.width) * size_t(plane.height));
    }
    return out;
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

bool fits_shorts(PixelFormat format, float white, const Image& black) {
    const auto [least, most] = std::minmax_element(black.data.begin(), black.data.end());
    return format == PixelFormat::u16 && white - *least <= largest_short && *most <= largest_short;
}

template <typename Sample>
ColorPlanes<Sample> black_planes(const Image& black, Cfa cfa, PixelFormat format) {
    auto out = empty_planes<Sample>(black.width, black.height, cfa);
    const auto places = color_places(cfa);
    for (size_t i = 0; i < places.size(); ++i) {
        auto& plane = out.planes[i];
        for (int y = 0; y < plane.height; ++y)
            for (int x = 0; x < plane.width; ++x) {
                const float level = black.at(places[i].first_x + x * places[i].step,
                                             places[i].first_y + y * places[i].step, places[i].channel);
                plane.samples[size_t(y) * size_t(plane.width) + size_t(x)] =
                    Sample(format == PixelFormat::u16 ? std::round(level) : level);
                out.largest = std::max(out.largest, int(std::lround(std::abs(level))));
            }
    }
    return out;
}

template <typename Sample>
void load_planes(const Frame& frame, float white, const ColorPlanes<Sample>& black,
                 std::vector<typename ColorPlanes<Sample>::Plane>& planes) {
    const auto places = color_places(frame.cfa);
    for (size_t i = 0; i < places.size(); ++i) {
        if (frame.format == PixelFormat::u16)
            load_plane<uint16_t>(frame, white, places[i], black.planes[i].samples, planes[i]);
        else
            load_plane<float>(frame, white, places[i], black.planes[i].samples, planes[i]);
    }
}

template <typename Sample>
ColorPlanes<Sample> color_planes(const Frame& frame, const ColorPlanes<Sample>& black) {
    auto out = empty_planes<Sample>(int(frame.width), int(frame.height), frame.cfa);
    out.largest = std::max(int(std::ceil(std::min(frame.white, 65535.0f))), black.largest);
    load_planes(frame, frame.white, black, out.planes);
    for (const auto& plane : out.planes)
        out.any_masked = out.any_masked || std::ranges::any_of(plane.samples, is_masked<Sample>);
    if (!out.any_masked) return out;
    out.clipped = out.planes;
    load_planes(frame, std::numeric_limits<float>::infinity(), black, out.clipped);
    if constexpr (std::is_same_v<Sample, int16_t>)  // a sensor may count beyond its white
        for (auto& plane : out.clipped)
            for (int16_t& sample : plane.samples) sample = std::min(sample, int16_t(out.largest));
    return out;
}

template ColorPlanes<int16_t> black_planes(const Image&, Cfa, PixelFormat);
template ColorPlanes<float> black_planes(const Image&, Cfa, PixelFormat);
template ColorPlanes<int16_t> color_planes(const Frame&, const ColorPlanes<int16_t>&);
template ColorPlanes<float> color_planes(const Frame&, const ColorPlanes<float>&);

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
