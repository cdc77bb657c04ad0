// SPDX-License-Identifier: MIT
// Loading of bands; a row of one frame, as nearly all are, goes straight from counts to counts.
#include "develop/row_band.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "demultiplex/masked_sample.hpp"
#include "develop/above_black.hpp"
#include "develop/align.hpp"

namespace ols {

namespace {

template <typename Sum>
using SampleOf = std::conditional_t<std::is_integral_v<Sum>, uint16_t, float>;

template <typename Sum>
const SampleOf<Sum>* samples_of(const Frame& frame, const Band& band, size_t y) {
    const std::byte* row = frame.samples.data() + (band.first_row + y) * frame.pitch_bytes;
    return reinterpret_cast<const SampleOf<Sum>*>(row) + band.channel;
}

// The black level of each sample, whole for integer sums.
template <typename Sum>
std::vector<Sum> prepare_black(RowBand<Sum>& loaded, const Band& band, const Image& black, float white) {
    std::vector<Sum> level(band.samples());
    for (size_t p = 0; p < band.samples(); ++p) {
        const float counts = black.data[(band.first_pixel() + p) * size_t(band.channels) + size_t(band.channel)];
        level[p] = std::is_integral_v<Sum> ? Sum(std::round(counts)) : Sum(counts);
        loaded.black_rest[p] = counts - float(level[p]);
        loaded.white[p] = white - float(level[p]);
    }
    return level;
}

// Marks samples at or above white, and others that are not finite.
template <typename Count>
void mark_unseen(const Count* samples, size_t step, float white, std::span<uint8_t> masked) {
    for (size_t x = 0; x < masked.size(); ++x) {
        const auto value = float(samples[x * step]);
        if (value >= white)
            masked[x] |= mask_saturated;
        else if (!std::isfinite(value))
            masked[x] |= mask_missing;
    }
}

template <typename Sum>
void load_frame(const Frame& frame, const Band& band, const std::vector<Sum>& black, bool clipped_stay, Sum* out,
                std::vector<uint8_t>& masked) {
    constexpr int most = std::is_same_v<Sum, int16_t> ? 32767 : 65535;
    const auto step = size_t(band.channels);
    for (size_t y = 0; y < band.rows; ++y) {
        const auto* samples = samples_of<Sum>(frame, band, y);
        const size_t first = y * band.width;
        const auto subtract = [&](float white) {
            return subtract_black(samples, step, {white, most}, &black[first], band.width, out + first);
        };
        if (!subtract(frame.white)) continue;
        mark_unseen(samples, step, frame.white, {&masked[first], band.width});
        if (clipped_stay) subtract(std::numeric_limits<float>::infinity());
    }
}

// Asks for a band of a frame ahead of its turn. Frames lie far apart, and of each a band is a few kilobytes: too short a stretch for the
// processor to foresee the next one, so that loading would wait for memory at each.
void fetch_ahead(const Frame& frame, const Band& band) {
    constexpr size_t line_bytes = 64;
    const std::byte* const first = frame.samples.data() + band.first_row * frame.pitch_bytes;
    for (size_t at = 0; at < band.rows * frame.pitch_bytes; at += line_bytes) __builtin_prefetch(first + at);
}

// The mean of several frames, of the samples that none of them has masked.
template <typename Sum>
void load_mean(const std::vector<std::shared_ptr<const Frame>>& frames, const Band& band, const std::vector<Sum>& black,
               bool clipped_stay, std::span<Sum> out, std::vector<uint8_t>& masked) {
    std::vector<float> sums(band.samples()), counts(band.samples());
    for (const auto& frame : frames) {
        load_frame(*frame, band, black, clipped_stay, out.data(), masked);
        for (size_t p = 0; p < out.size(); ++p) {
            if (is_masked(out[p])) continue;
            sums[p] += float(out[p]);
            counts[p] += 1;
        }
    }
    for (size_t p = 0; p < out.size(); ++p) sums[p] = counts[p] > 0 ? sums[p] / counts[p] : 0;
    if constexpr (std::is_integral_v<Sum>) {
        std::vector<int32_t> whole(sums.size());
        align_samples(sums, whole);
        std::ranges::copy(whole, out.begin());
    } else {
        std::ranges::copy(sums, out.begin());
    }
    for (size_t p = 0; p < out.size(); ++p)
        if (counts[p] == 0) out[p] = masked_sample<Sum>;
}

}  // namespace

// Rows begin on cache lines, an odd number of these apart: were they a multiple of 4 KB apart, the same samples of all rows
// would contend for one set of the nearest cache.
template <typename Sum>
RowBand<Sum>::RowBand(size_t rows, size_t samples)
    : masked(samples),
      black_rest(samples),
      white(samples),
      rows_(rows),
      pitch_([&] {
          constexpr size_t line = 64 / sizeof(Sum);
          return ((samples + line - 1) / line | 1) * line;
      }()),
      samples_(rows * pitch_) {}

template <typename Sum>
RowBand<Sum> RecordedRows<Sum>::load(const Band& band, const Frame& like, const Image& black, bool clipped_stay) const {
    RowBand<Sum> loaded(rows.size(), band.samples());
    const auto level = prepare_black(loaded, band, black, like.white);
    for (size_t row = 0; row < rows.size(); ++row) {
        Sum* const out = loaded.row(row);
        if (row + 1 < rows.size() && !rows[row + 1].empty()) fetch_ahead(*rows[row + 1][0], band);
        if (rows[row].empty()) {
            std::fill_n(out, band.samples(), masked_sample<Sum>);
            for (uint8_t& mark : loaded.masked) mark |= mask_missing;
        } else if (rows[row].size() == 1) {
            load_frame(*rows[row][0], band, level, clipped_stay, out, loaded.masked);
        } else {
            load_mean(rows[row], band, level, clipped_stay, {out, band.samples()}, loaded.masked);
        }
    }
    return loaded;
}

template class RowBand<int16_t>;
template class RowBand<int32_t>;
template class RowBand<float>;
template struct RecordedRows<int16_t>;
template struct RecordedRows<int32_t>;
template struct RecordedRows<float>;

}  // namespace ols
