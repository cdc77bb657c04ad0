// SPDX-License-Identifier: MIT
// (read + shot sqrt y)^2 = read^2 + 2 read shot sqrt y + shot^2 y: rows of equal weight need but the sums of y and of sqrt y,
// which blocks of samples add up row by row in the nearest cache. Samples with a masked count are done again by themselves.
#include "demultiplex/variance.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "demultiplex/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "demultiplex/variance.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Longs = hn::RebindToSigned<Floats>;

HWY_INLINE auto load_counts(const int32_t* from) {
    return hn::LoadU(Longs(), from);
}
HWY_INLINE auto load_counts(const int16_t* from) {
    return hn::PromoteTo(Longs(), hn::LoadU(hn::Rebind<int16_t, Longs>(), from));
}

// counts[i] += max(row[i], 0), roots[i] += its square root. The least count; `count` is a multiple of 16.
template <typename Count>
int32_t add_row_of(const Count* row, size_t count, float* counts, float* roots) {
    const Floats df;
    const Longs di;
    auto least = hn::Set(di, std::numeric_limits<int32_t>::max());
    for (size_t i = 0; i < count; i += hn::Lanes(df)) {
        const auto value = load_counts(row + i);
        least = hn::Min(least, value);
        const auto light = hn::ConvertTo(df, hn::Max(value, hn::Zero(di)));
        hn::StoreU(hn::Add(hn::LoadU(df, counts + i), light), df, counts + i);
        hn::StoreU(hn::Add(hn::LoadU(df, roots + i), hn::Sqrt(light)), df, roots + i);
    }
    return hn::GetLane(hn::MinOfLanes(di, least));
}

int32_t add_long_row(const int32_t* row, size_t count, float* counts, float* roots) {
    return add_row_of(row, count, counts, roots);
}
int32_t add_short_row(const int16_t* row, size_t count, float* counts, float* roots) {
    return add_row_of(row, count, counts, roots);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(add_long_row);
HWY_EXPORT(add_short_row);

namespace {

constexpr size_t block_samples = 512;  // five lists of floats: 10 KB

int32_t add_row(const int32_t* row, size_t count, float* counts, float* roots) {
    return HWY_DYNAMIC_DISPATCH(add_long_row)(row, count, counts, roots);
}
int32_t add_row(const int16_t* row, size_t count, float* counts, float* roots) {
    return HWY_DYNAMIC_DISPATCH(add_short_row)(row, count, counts, roots);
}

}  // namespace

// Sums of one block of samples.
template <typename Count>
class VarianceEstimate::Block {
  public:
    Block(const VarianceEstimate& estimate, std::span<const Count* const> rows) : estimate_(estimate), rows_(rows) {}

    // The variance before gain, of the samples from `begin`.
    const float* sum(size_t begin, size_t count) {
        std::fill_n(weighted_, block_samples, 0.0f);
        std::fill_n(noise_, block_samples, 0.0f);
        double lost_weight = 0;
        int shown = 0;
        bool has_masked = false;
        for (const RowClass& rows : estimate_.classes_) {
            const int present = add_class(rows, begin, count, has_masked);
            lost_weight += rows.weight * double(rows.rows.size() - size_t(present));
            shown += present;
        }
        if (shown == 0) return all_masked(count);
        const float each_lost = float(lost_weight / shown);
        for (size_t i = 0; i < block_samples; ++i) weighted_[i] += each_lost * noise_[i];
        if (has_masked)
            for (size_t i = 0; i < count; ++i) sum_masked(begin + i, weighted_[i]);
        return weighted_;
    }

  private:
    // The number of its rows that are not lost.
    int add_class(const RowClass& rows, size_t begin, size_t count, bool& has_masked) {
        std::fill_n(counts_, block_samples, 0.0f);
        std::fill_n(roots_, block_samples, 0.0f);
        int present = 0;
        for (const int row : rows.rows) {
            const Count* from = rows_[size_t(row)];
            if (!from) continue;
            ++present;
            from += begin;
            if (count < block_samples) from = std::copy_n(from, count, rest_) - count;
            has_masked |= add_row(from, block_samples, counts_, roots_) == int32_t(masked_sample<Count>);
        }
        const auto [read, shot] = estimate_.noise_;
        const float constant = float(present * read * read), root = float(2 * read * shot), linear = float(shot * shot);
        for (size_t i = 0; i < block_samples; ++i) {
            const float noise = constant + root * roots_[i] + linear * counts_[i];
            noise_[i] += noise;
            weighted_[i] += float(rows.weight) * noise;
        }
        return present;
    }

    const float* all_masked(size_t count) {
        double weight = 0;
        for (const RowClass& rows : estimate_.classes_) weight += rows.weight * double(rows.rows.size());
        std::fill_n(weighted_, count, float(weight * estimate_.noise_.read_counts * estimate_.noise_.read_counts));
        return weighted_;
    }

    // One sample again, if a count of it is masked.
    void sum_masked(size_t sample, float& out) const {
        double weighted = 0, masked_weight = 0, noise = 0;
        int shown = 0, masked = 0;
        const auto [read, shot] = estimate_.noise_;
        for (const RowClass& rows : estimate_.classes_)
            for (const int row : rows.rows) {
                const Count* const from = rows_[size_t(row)];
                if (!from || from[sample] == masked_sample<Count>) {
                    masked_weight += rows.weight;
                    masked += from != nullptr;
                    continue;
                }
                const double sigma = read + shot * std::sqrt(double(std::max<int32_t>(from[sample], 0)));
                weighted += rows.weight * sigma * sigma;
                noise += sigma * sigma;
                ++shown;
            }
        if (masked) out = float(weighted + masked_weight * (shown ? noise / shown : read * read));
    }

    const VarianceEstimate& estimate_;
    std::span<const Count* const> rows_;
    Count rest_[block_samples] = {};
    float counts_[block_samples], roots_[block_samples], noise_[block_samples], weighted_[block_samples];
};

VarianceEstimate::VarianceEstimate(const Basis& basis, const NoiseModel& noise)
    : noise_(noise), row_count_(basis.rows) {
    for (int row = 0; row < basis.rows; ++row) {
        double squares = 0;
        for (int i = 0; i < basis.images(); ++i) squares += basis.inverse(row, i) * basis.inverse(row, i);
        const double weight = squares / basis.images();
        // Equal but for the rounding of the sum.
        const auto same = std::find_if(classes_.begin(), classes_.end(), [&](const RowClass& rows) {
            return std::abs(rows.weight - weight) <= 1e-12 * weight;
        });
        if (same == classes_.end())
            classes_.push_back({weight, {row}});
        else
            same->rows.push_back(row);
    }
}

template <typename Count>
void VarianceEstimate::estimate_all(std::span<const Count* const> rows, size_t samples, std::span<const float> gain,
                                    float* out) const {
    assert(int(rows.size()) == row_count_ && (gain.empty() || gain.size() == samples));
    Block<Count> block(*this, rows);
    for (size_t begin = 0; begin < samples; begin += block_samples) {
        const size_t count = std::min(block_samples, samples - begin);
        const float* const sums = block.sum(begin, count);
        for (size_t i = 0; i < count; ++i) {
            const float factor = gain.empty() ? 1.0f : gain[begin + i];
            out[begin + i] = factor * factor * sums[i];
        }
    }
}

void VarianceEstimate::estimate(std::span<const int32_t* const> rows, size_t samples, std::span<const float> gain,
                                float* out) const {
    estimate_all(rows, samples, gain, out);
}

void VarianceEstimate::estimate(std::span<const int16_t* const> rows, size_t samples, std::span<const float> gain,
                                float* out) const {
    estimate_all(rows, samples, gain, out);
}

}  // namespace ols
#endif
