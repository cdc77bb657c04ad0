// SPDX-License-Identifier: MIT
// Block means of a frame; the sums of counts compiled once for each vector path.
#include "record/frame_summary.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "record/frame_summary.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE auto load_counts(D d, const uint16_t* counts) {
    return hn::PromoteTo(d, hn::LoadU(hn::Rebind<uint16_t, D>(), counts));
}

// sums[column] += the counts of rows, pitch_bytes apart, from edges[column] to edges[column + 1]. Of up to 8 rows: 32 bits hold the sum of
// so many of a block, as frames are at most 16384 pixels of three samples wide.
void add_rows(const std::byte* samples, size_t pitch_bytes, size_t rows, const size_t* edges, double* sums) {
    const hn::ScalableTag<uint32_t> d;
    const hn::CappedTag<uint32_t, 4> d4;
    const size_t step = hn::Lanes(d), step4 = hn::Lanes(d4);
    for (size_t column = 0; column < FrameSummary::grid; ++column) {
        auto many = hn::Zero(d);
        auto few = hn::Zero(d4);
        uint32_t rest = 0;
        for (size_t y = 0; y < rows; ++y) {
            const auto* const row = reinterpret_cast<const uint16_t*>(samples + y * pitch_bytes);
            size_t x = edges[column];
            const size_t end = edges[column + 1];
            for (; x + step <= end; x += step) many = hn::Add(many, load_counts(d, row + x));
            for (; x + step4 <= end; x += step4) few = hn::Add(few, load_counts(d4, row + x));
            for (; x < end; ++x) rest += row[x];
        }
        sums[column] += double(hn::GetLane(hn::SumOfLanes(d, many)) + hn::GetLane(hn::SumOfLanes(d4, few)) + rest);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(add_rows);

namespace {

constexpr size_t rows_at_once = 8;

// Floats in double, in order, so that every machine gets the same bits.
void add_row(const float* row, const size_t* edges, double* sums) {
    for (size_t column = 0; column < FrameSummary::grid; ++column) {
        double sum = 0;
        for (size_t x = edges[column]; x < edges[column + 1]; ++x) sum += double(row[x]);
        sums[column] += sum;
    }
}

}  // namespace

BlockSums::BlockSums(const Frame& frame)
    : width_(frame.width), height_(frame.height), channels_(size_t(samples_per_pixel(frame.cfa))) {}

void BlockSums::add(const Frame& frame, uint32_t first_row, uint32_t rows, const std::byte* samples) {
    size_t edges[grid + 1];
    for (size_t column = 0; column <= grid; ++column) edges[column] = column * width_ / grid * channels_;
    const size_t pitch = frame.pitch_bytes, end = size_t(first_row) + rows;
    for (size_t y = first_row, next; y < end; samples += (next - y) * pitch, y = next) {
        const size_t block_row = y * grid / height_, block_end = ((block_row + 1) * height_ + grid - 1) / grid;
        next = std::min({end, block_end, y + rows_at_once});
        double* const sums = &sums_[block_row * grid];
        if (frame.format == PixelFormat::u16)
            HWY_DYNAMIC_DISPATCH(add_rows)(samples, pitch, next - y, edges, sums);
        else
            for (size_t n = 0; n < next - y; ++n)
                add_row(reinterpret_cast<const float*>(samples + n * pitch), edges, sums);
    }
}

FrameSummary BlockSums::summary(double black_counts, const NoiseModel& noise) const {
    FrameSummary summary;
    size_t smallest = SIZE_MAX;
    for (size_t b = 0; b < grid * grid; ++b) {
        const size_t width = (b % grid + 1) * width_ / grid - b % grid * width_ / grid;
        // Row y belongs to block row floor(y grid / height): those from ceil(r height / grid) on.
        const auto first_row = [&](size_t r) { return (r * height_ + grid - 1) / grid; };
        const size_t samples = width * channels_ * (first_row(b / grid + 1) - first_row(b / grid));
        smallest = std::min(smallest, samples);
        summary.blocks[b] = float(sums_[b] / double(samples) - black_counts);
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
#endif
