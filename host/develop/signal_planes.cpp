// SPDX-License-Identifier: MIT
// From interleaved samples of either format to planes.
#include "develop/signal_planes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "develop/above_black.hpp"

namespace ols {

namespace {

constexpr int largest_short = 16383;  // warp_counts()

template <typename Count, typename Sample>
bool subtract_channel(const Frame& frame, size_t channel, const SampleLimits& limits,
                      const MarginedPlane<Sample>& black, MarginedPlane<Sample>& out) {
    const auto step = size_t(samples_per_pixel(frame.cfa));
    bool masked = false;
    for (int y = 0; y < int(frame.height); ++y) {
        const auto* samples =
            reinterpret_cast<const Count*>(frame.samples.data() + size_t(y) * frame.pitch_bytes) + channel;
        masked |= subtract_black(samples, step, limits, black.row(y), frame.width, out.row(y));
    }
    out.fill_margin();
    return masked;
}

// The channels, and whether any sample is masked.
template <typename Sample>
bool subtract(const Frame& frame, const SampleLimits& limits, const SignalPlanes<Sample>& black,
              typename SignalPlanes<Sample>::Channels& channels) {
    bool masked = false;
    for (size_t c = 0; c < black.channels.size(); ++c) {
        auto& out = channels.emplace_back(black.channels[c].grid());
        if (std::is_same_v<Sample, int16_t> || frame.format == PixelFormat::u16)
            masked |= subtract_channel<uint16_t>(frame, c, limits, black.channels[c], out);
        else if constexpr (std::is_same_v<Sample, float>)
            masked |= subtract_channel<float>(frame, c, limits, black.channels[c], out);
    }
    return masked;
}

}  // namespace

SampleGrid sample_grid(int width, int height, Cfa cfa) {
    return {width, height, cfa == Cfa::none || cfa == Cfa::rgb ? 1 : 2};
}

bool fits_shorts(PixelFormat format, float white, const Image& black) {
    const auto [least, most] = std::minmax_element(black.data.begin(), black.data.end());
    return format == PixelFormat::u16 && white <= largest_short && *least >= 0 && *most <= largest_short;
}

template <typename Sample>
MarginedPlane<Sample>::MarginedPlane(const SampleGrid& grid)
    : grid_(grid),
      pitch_((size_t(grid.width) + 2 * margin + 31) / 32 * 32),
      samples_(pitch_ * size_t(grid.height + 2 * margin)) {}

template <typename Sample>
void MarginedPlane<Sample>::fill_margin() {
    const int step = grid_.step;
    // The outermost of the colour that lies at a place of the margin: a frame that is narrower than a mosaic's two has none of
    // it, and takes what there is.
    const auto held = [step](int at, int size) {
        const int first = (at % step + step) % step;
        if (at < 0) return std::min(first, size - 1);
        return std::max(0, at - (at - size) / step * step - step);
    };
    int left[margin], right[margin];
    for (int k = 0; k < margin; ++k) {
        left[k] = held(k - margin, grid_.width);
        right[k] = held(grid_.width + k, grid_.width);
    }
    for (int y = 0; y < grid_.height; ++y) {
        Sample* const samples = row(y);
        for (int k = 0; k < margin; ++k) samples[k - margin] = samples[left[k]];
        for (int k = 0; k < margin; ++k) samples[grid_.width + k] = samples[right[k]];
    }
    for (int k = 1; k <= margin; ++k) {
        std::copy_n(row(held(-k, grid_.height)) - margin, pitch_, row(-k) - margin);
        std::copy_n(row(held(grid_.height + k - 1, grid_.height)) - margin, pitch_, row(grid_.height + k - 1) - margin);
    }
}

template <typename Sample>
SignalPlanes<Sample> black_planes(const Image& black, Cfa cfa, PixelFormat format) {
    SignalPlanes<Sample> out;
    const int channels = samples_per_pixel(cfa);
    for (int c = 0; c < channels; ++c) {
        auto& plane = out.channels.emplace_back(sample_grid(black.width, black.height, cfa));
        for (int y = 0; y < black.height; ++y)
            for (int x = 0; x < black.width; ++x) {
                const float level = black.at(x, y, c);
                plane.row(y)[x] = Sample(format == PixelFormat::u16 ? std::round(level) : level);
                out.largest = std::max(out.largest, int(std::lround(std::abs(level))));
            }
    }
    return out;
}

template <typename Sample>
SignalPlanes<Sample> signal_planes(const Frame& frame, const SignalPlanes<Sample>& black, bool keeps_clipped) {
    SignalPlanes<Sample> out;
    out.largest = std::max(int(std::ceil(std::min(frame.white, 65535.0f))), black.largest);
    // A sensor may count beyond its white, by more than 16 signed bits hold.
    out.any_masked = subtract(frame, {frame.white, out.largest}, black, out.channels);
    if (out.any_masked && keeps_clipped)
        subtract(frame, {std::numeric_limits<float>::infinity(), out.largest}, black, out.clipped);
    return out;
}

template class MarginedPlane<int16_t>;
template class MarginedPlane<float>;
template SignalPlanes<int16_t> black_planes(const Image&, Cfa, PixelFormat);
template SignalPlanes<float> black_planes(const Image&, Cfa, PixelFormat);
template SignalPlanes<int16_t> signal_planes(const Frame&, const SignalPlanes<int16_t>&, bool);
template SignalPlanes<float> signal_planes(const Frame&, const SignalPlanes<float>&, bool);

}  // namespace ols
