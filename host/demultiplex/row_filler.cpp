// SPDX-License-Identifier: MIT
// Grouping of a tile's samples by what is masked in them, and the fills that were used last.
#include "demultiplex/row_filler.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "demultiplex/bounded_fill.hpp"
#include "demultiplex/fill_sums.hpp"

namespace ols {

std::shared_ptr<const RowFill> FillCache::fill_for(const std::vector<int>& masked) {
    {
        const std::lock_guard lock(mutex_);
        if (const auto known = entries_.find(masked); known != entries_.end()) {
            uses_.splice(uses_.begin(), uses_, known->second.use);
            return known->second.fill;
        }
    }
    // Made outside of the lock: another thread may make the same one, which is as good.
    auto made = std::make_shared<const RowFill>(row_fill(model_, masked, estimate_));
    const std::lock_guard lock(mutex_);
    if (entries_.contains(masked)) return made;
    uses_.push_front(masked);
    entries_[masked] = {made, uses_.begin()};
    if (entries_.size() > capacity_) {
        entries_.erase(uses_.back());
        uses_.pop_back();
    }
    return made;
}

namespace {

struct alignas(64) TileRow {
    float samples[tile_samples];
};

}  // namespace

// The samples as floats, masked ones 0 until they are filled, and which those are.
struct RowFiller::Tile {
    explicit Tile(size_t row_count) : rows(row_count), masked(row_count) {}

    std::vector<int> masked_rows(size_t sample) const {
        std::vector<int> found;
        for (size_t row = 0; row < masked.size(); ++row)
            if (masked[row] >> sample & 1) found.push_back(int(row));
        return found;
    }

    // The samples that have the same rows masked as this one, itself included.
    uint64_t alike(size_t sample) const {
        uint64_t same = ~uint64_t(0);
        for (const uint64_t row : masked) same &= row >> sample & 1 ? row : ~row;
        return same;
    }

    std::vector<TileRow> rows;
    std::vector<uint64_t> masked;  // a bit a sample
};

void RowFiller::bound(const RowFill& fill, Tile& tile, size_t sample, size_t at) const {
    Eigen::VectorXd counts(Eigen::Index(tile.rows.size()));
    double known = 0;
    const double offset = knowledge_.offset.empty() ? 0 : knowledge_.offset[at];
    for (size_t row = 0; row < tile.rows.size(); ++row) {
        const double count = tile.rows[row].samples[sample] - offset;
        counts(Eigen::Index(row)) = count;
        if (!(tile.masked[row] >> sample & 1)) known += std::max(count, 0.0);
    }
    const double mean = known / double(tile.rows.size() - fill.masked.size());
    FillBounds bounds{knowledge_.noise.read_counts + knowledge_.noise.shot * std::sqrt(mean), {}};
    for (const int row : fill.masked) {
        const bool lost =
            knowledge_.white.empty() || (!knowledge_.lost_rows.empty() && knowledge_.lost_rows[size_t(row)]);
        bounds.least.push_back(lost ? -std::numeric_limits<double>::infinity() : knowledge_.white[at] - offset);
    }
    bound_fill(cache_.model(), fill.masked, bounds, counts);
    for (const int row : fill.masked) tile.rows[size_t(row)].samples[sample] = float(counts(row) + offset);
}

void RowFiller::fill(Tile& tile, size_t begin) const {
    uint64_t left = 0;
    for (const uint64_t row : tile.masked) left |= row;
    std::vector<TileRow> sums;
    while (left) {
        const auto first = size_t(std::countr_zero(left));
        const uint64_t group = tile.alike(first);
        left &= ~group;
        const auto fill = cache_.fill_for(tile.masked_rows(first));
        const SampleFill told{fill->kind, float(fill->noise_gain), float(fill->worst_noise_gain), float(fill->power),
                              float(fill->worst_power)};
        sums.resize(fill->masked.size());
        if (!fill->weights.empty())
            sum_weighted_rows(fill->weights, tile.rows.size(), tile.rows[0].samples, group, sums[0].samples);
        for (uint64_t todo = group; todo; todo &= todo - 1) {
            const auto sample = size_t(std::countr_zero(todo));
            const float offset = knowledge_.offset.empty() ? 0 : knowledge_.offset[begin + sample];
            fills_[begin + sample] = told;
            for (size_t k = 0; k < sums.size() && !fill->weights.empty(); ++k)
                tile.rows[size_t(fill->masked[k])].samples[sample] =
                    sums[k].samples[sample] + fill->offset_share[k] * offset;
            if (fill->kind == FillKind::estimated && cache_.estimate() == Estimate::nonnegative)
                bound(*fill, tile, sample, begin + sample);
        }
    }
}

void RowFiller::fill(int32_t* tile, size_t begin, size_t count) const {
    Tile floats(size_t(cache_.model().rows()));
    const uint64_t inside = ~uint64_t(0) >> (64 - count);
    for (size_t row = 0; row < floats.rows.size(); ++row) {
        const int32_t* const from = tile + row * tile_samples;
        floats.masked[row] = masked_samples(from) & inside;
        for (size_t i = 0; i < tile_samples; ++i) floats.rows[row].samples[i] = float(from[i]);
        for (uint64_t todo = floats.masked[row]; todo; todo &= todo - 1)
            floats.rows[row].samples[std::countr_zero(todo)] = 0;
    }
    fill(floats, begin);
    constexpr float count_max = 1 << 23;
    for (size_t row = 0; row < floats.rows.size(); ++row)
        for (uint64_t todo = floats.masked[row]; todo; todo &= todo - 1) {
            const auto i = size_t(std::countr_zero(todo));
            tile[row * tile_samples + i] =
                int32_t(std::round(std::clamp(floats.rows[row].samples[i], 1 - count_max, count_max - 1)));
        }
}

void RowFiller::fill(float* tile, size_t begin, size_t count) const {
    Tile floats(size_t(cache_.model().rows()));
    for (size_t row = 0; row < floats.rows.size(); ++row)
        for (size_t i = 0; i < count; ++i) {
            const float value = tile[row * tile_samples + i];
            floats.masked[row] |= uint64_t(std::isnan(value)) << i;
            floats.rows[row].samples[i] = std::isnan(value) ? 0 : value;
        }
    fill(floats, begin);
    for (size_t row = 0; row < floats.rows.size(); ++row)
        for (uint64_t todo = floats.masked[row]; todo; todo &= todo - 1) {
            const auto i = size_t(std::countr_zero(todo));
            tile[row * tile_samples + i] = floats.rows[row].samples[i];
        }
}

namespace {

template <typename Sample>
void fill_marked_tiles(const RowFiller& filler, std::span<Sample* const> rows, std::span<const uint8_t> masked) {
    std::vector<Sample> tile(rows.size() * tile_samples);
    for (size_t begin = 0; begin < masked.size(); begin += tile_samples) {
        const size_t count = std::min(tile_samples, masked.size() - begin);
        const auto marks = masked.subspan(begin, count);
        if (std::none_of(marks.begin(), marks.end(), [](uint8_t mark) { return mark != 0; })) continue;
        for (size_t r = 0; r < rows.size(); ++r) std::copy_n(rows[r] + begin, count, &tile[r * tile_samples]);
        filler.fill(tile.data(), begin, count);
        for (size_t r = 0; r < rows.size(); ++r) std::copy_n(&tile[r * tile_samples], count, rows[r] + begin);
    }
}

}  // namespace

void fill_rows(const RowFiller& filler, std::span<int32_t* const> rows, std::span<const uint8_t> masked) {
    fill_marked_tiles(filler, rows, masked);
}

void fill_rows(const RowFiller& filler, std::span<float* const> rows, std::span<const uint8_t> masked) {
    fill_marked_tiles(filler, rows, masked);
}

}  // namespace ols
