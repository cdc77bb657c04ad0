// SPDX-License-Identifier: MIT
// Block means of a frame.
#include "record/frame_summary.hpp"

#include <algorithm>
#include <cmath>

namespace ols {

namespace {

template <typename Sample>
double sum_row(const std::byte* row, size_t begin, size_t end) {
    const auto* samples = reinterpret_cast<const Sample*>(row);
    // 16-bit counts add up exactly, those of a block's row in 32 bits (frames are at most 16384 pixels wide); floats in double, in order,
    // so that every machine gets the same bits.
    std::conditional_t<std::is_integral_v<Sample>, uint32_t, double> sum = 0;
    for (size_t x = begin; x < end; ++x) sum += samples[x];
    return double(sum);
}

}  // namespace

FrameSummary summarize_frame(const Frame& frame, double black_counts, const NoiseModel& noise) {
    constexpr size_t grid = FrameSummary::grid;
    const size_t channels = size_t(samples_per_pixel(frame.cfa));
    std::array<double, grid * grid> sums{};
    for (size_t y = 0; y < frame.height; ++y) {
        const std::byte* row = frame.samples.data() + y * frame.pitch_bytes;
        for (size_t column = 0; column < grid; ++column) {
            const size_t begin = column * frame.width / grid * channels;
            const size_t end = (column + 1) * frame.width / grid * channels;
            sums[y * grid / frame.height * grid + column] +=
                frame.format == PixelFormat::u16 ? sum_row<uint16_t>(row, begin, end) : sum_row<float>(row, begin, end);
        }
    }
    FrameSummary summary;
    size_t smallest = SIZE_MAX;
    for (size_t b = 0; b < grid * grid; ++b) {
        const size_t width = (b % grid + 1) * frame.width / grid - b % grid * frame.width / grid;
        // Row y belongs to block row floor(y grid / height): those from ceil(r height / grid) on.
        const auto first_row = [&](size_t r) { return (r * frame.height + grid - 1) / grid; };
        const size_t samples = width * channels * (first_row(b / grid + 1) - first_row(b / grid));
        smallest = std::min(smallest, samples);
        summary.blocks[b] = float(sums[b] / double(samples) - black_counts);
    }
    summary.noise = float(noise.read_counts / std::sqrt(double(smallest)));
    return summary;
}

bool is_dark(const FrameSummary& summary) {
    const float limit = 6 * summary.noise + black_drift_counts;
    return std::all_of(summary.blocks.begin(), summary.blocks.end(),
                       [&](float block) { return std::abs(block) <= limit; });
}

double difference(const FrameSummary& a, const FrameSummary& b) {
    double apart = 0, sum_a = 0, sum_b = 0;
    for (size_t i = 0; i < a.blocks.size(); ++i) {
        apart += std::abs(double(a.blocks[i]) - b.blocks[i]);
        sum_a += std::abs(double(a.blocks[i]));
        sum_b += std::abs(double(b.blocks[i]));
    }
    const double larger = std::max(sum_a, sum_b);
    return larger > 0 ? apart / larger : 0;
}

}  // namespace ols
