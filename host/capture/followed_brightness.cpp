// SPDX-License-Identifier: MIT
// Finds the blocks of samples that may change in each interval, once for all of its slots; the others are not touched.
#include "capture/followed_brightness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "reflectance/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "capture/followed_brightness.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#ifndef OLS_FOLLOWED_BRIGHTNESS_TYPES
#define OLS_FOLLOWED_BRIGHTNESS_TYPES
namespace ols {

constexpr size_t block_samples = 16;  // divides a cache line of any kind of sample: rows of a band are padded to lines

// One interval, for a slot at a fraction of it.
template <typename Sum>
struct Following {
    const std::vector<uint32_t>& blocks;
    const Sum *first, *last, *now;
    const float* least;
    float first_scale, last_scale, fraction;
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, block_samples>;
using Longs = hn::RebindToSigned<Floats>;
using FloatVector = hn::Vec<Floats>;
using FloatMask = hn::Mask<Floats>;

struct Samples {
    FloatVector value;
    FloatMask is_seen;
};

template <typename Sum>
HWY_INLINE Samples load(const Sum* at) {
    const Floats d;
    if constexpr (std::is_same_v<Sum, float>) {
        const FloatVector value = hn::LoadU(d, at);
        return {value, hn::Eq(value, value)};
    } else {
        const Longs di;
        auto counts = hn::Zero(di);
        if constexpr (sizeof(Sum) == 2)
            counts = hn::PromoteTo(di, hn::LoadU(hn::Rebind<int16_t, Floats>(), at));
        else
            counts = hn::LoadU(di, at);
        return {hn::ConvertTo(d, counts), hn::RebindMask(d, hn::Ne(counts, hn::Set(di, masked_sample<Sum>)))};
    }
}

template <typename Sum>
HWY_INLINE void store(FloatMask changes, FloatVector value, Sum* at) {
    const Floats d;
    if constexpr (std::is_same_v<Sum, float>) {
        hn::StoreU(hn::IfThenElse(changes, value, hn::LoadU(d, at)), d, at);
    } else {
        const Longs di;
        // What fits_shorts() promises of shorts, and SampleFiller asks of others.
        constexpr float most = sizeof(Sum) == 2 ? 16383.0f : 8388607.0f;
        const auto held = hn::Min(hn::Max(value, hn::Set(d, -most)), hn::Set(d, most));
        const auto counts = hn::ConvertTo(di, hn::Add(held, hn::CopySign(hn::Set(d, 0.5f), held)));
        const auto is_changed = hn::RebindMask(di, changes);
        if constexpr (sizeof(Sum) == 2) {
            const hn::Rebind<int16_t, Floats> d16;
            const auto before = hn::PromoteTo(di, hn::LoadU(d16, at));
            hn::StoreU(hn::DemoteTo(d16, hn::IfThenElse(is_changed, counts, before)), d16, at);
        } else {
            hn::StoreU(hn::IfThenElse(is_changed, counts, hn::LoadU(di, at)), di, at);
        }
    }
}

template <typename Sum>
void follow_in(const Following<Sum>& following, Sum* samples) {
    constexpr float largest_factor = 4;
    const Floats d;
    const auto fraction = hn::Set(d, following.fraction), zero = hn::Zero(d);
    const auto first_scale = hn::Set(d, following.first_scale), last_scale = hn::Set(d, following.last_scale);
    const auto most = hn::Set(d, largest_factor), least = hn::Set(d, 1 / largest_factor);
    for (const uint32_t block : following.blocks)
        for (size_t at = block * block_samples; at < (block + 1) * block_samples; at += hn::Lanes(d)) {
            const Samples first = load(following.first + at), last = load(following.last + at);
            const Samples now = load(following.now + at), sample = load(samples + at);
            const auto begin = hn::Mul(first.value, first_scale), end = hn::Mul(last.value, last_scale);
            const auto then = hn::Add(begin, hn::Mul(fraction, hn::Sub(end, begin)));
            // NaN is not greater than anything.
            const auto differs = hn::Gt(hn::Abs(hn::Sub(now.value, then)), hn::LoadU(d, following.least + at));
            const auto is_seen = hn::And(hn::And(first.is_seen, last.is_seen), sample.is_seen);
            const auto changes = hn::And(differs, is_seen);
            if (hn::AllFalse(d, changes)) continue;
            const auto lit = hn::Max(now.value, zero);
            const auto quotient = hn::Min(hn::Max(hn::Div(lit, then), least), most);
            const auto factor =
                hn::IfThenElse(hn::Gt(then, zero), quotient, hn::IfThenElse(hn::Gt(lit, then), most, least));
            store(changes, hn::Mul(sample.value, factor), samples + at);
        }
}

void follow_shorts(const Following<int16_t>& following, int16_t* samples) {
    follow_in(following, samples);
}
void follow_longs(const Following<int32_t>& following, int32_t* samples) {
    follow_in(following, samples);
}
void follow_floats(const Following<float>& following, float* samples) {
    follow_in(following, samples);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(follow_shorts);
HWY_EXPORT(follow_longs);
HWY_EXPORT(follow_floats);

namespace {

constexpr double standard_deviations = 6;

void follow(const Following<int16_t>& following, int16_t* samples) {
    HWY_DYNAMIC_DISPATCH(follow_shorts)(following, samples);
}
void follow(const Following<int32_t>& following, int32_t* samples) {
    HWY_DYNAMIC_DISPATCH(follow_longs)(following, samples);
}
void follow(const Following<float>& following, float* samples) {
    HWY_DYNAMIC_DISPATCH(follow_floats)(following, samples);
}

// Whether T and T0 may differ by more than `least` somewhere in the interval, for some sample of the block.
template <typename Sum>
bool may_change(const Sum* first, const Sum* last, const Sum* now, float first_scale, float last_scale,
                const float* least) {
    int changes = 0;
    for (size_t i = 0; i < block_samples; ++i) {
        const float here = float(now[i]), begin = first_scale * float(first[i]), end = last_scale * float(last[i]);
        const float most = std::max(std::abs(begin - here), std::abs(end - here));
        changes |= int(most > least[i]);
    }
    return changes != 0;
}

// The count that stands ten standard deviations of its noise above black: y = 10 (read + shot sqrt y). Masked ones, the least
// integer or NaN, are not above it.
double least_lit(const NoiseModel& noise) {
    constexpr double deviations = 10;
    const double half = deviations * noise.shot / 2,
                 root = half + std::sqrt(half * half + deviations * noise.read_counts);
    return root * root;
}

}  // namespace

template <typename Sum>
std::vector<float> relative_light(std::span<const RowBand<Sum>> bands, size_t instant, const NoiseModel& noise) {
    constexpr size_t fewest = 64;
    const auto least = float(least_lit(noise));
    std::vector<std::vector<uint32_t>> lit(bands.size());  // of each band, where the target's own frame is
    for (size_t b = 0; b < bands.size(); ++b)
        for (size_t p = 0; p < bands[b].masked.size(); ++p)
            if (float(bands[b].row(instant)[p]) > least) lit[b].push_back(uint32_t(p));
    std::vector<float> light(bands.front().rows(), 1.0f), quotients;
    for (size_t k = 0; k < light.size(); ++k) {
        if (k == instant) continue;
        quotients.clear();
        for (size_t b = 0; b < bands.size(); ++b)
            for (const uint32_t p : lit[b])
                if (const auto now = float(bands[b].row(instant)[p]), then = float(bands[b].row(k)[p]); then > least)
                    quotients.push_back(then / now);
        if (quotients.size() < fewest) continue;
        const auto middle = quotients.begin() + std::ptrdiff_t(quotients.size() / 2);
        std::ranges::nth_element(quotients, middle);
        light[k] = *middle;
    }
    return light;
}

template <typename Sum>
FollowedBrightness<Sum>::FollowedBrightness(RowBand<Sum> knots, std::vector<float> light, size_t instant,
                                            const NoiseModel& noise)
    : knots_(std::move(knots)), scale_(std::move(light)), instant_(instant), blocks_(knots_.rows() - 1) {
    for (float& scale : scale_) scale = 1 / scale;
    const size_t samples = knots_.masked.size(), blocks = (samples + block_samples - 1) / block_samples;
    const Sum* const now = knots_.row(instant_);
    least_.assign(blocks * block_samples, std::numeric_limits<float>::infinity());
    for (size_t p = 0; p < samples; ++p) {
        if (is_masked(now[p])) continue;
        const double sigma = noise.read_counts + noise.shot * std::sqrt(std::max(0.0, double(now[p])));
        least_[p] = float(standard_deviations * M_SQRT2 * sigma);
    }
    for (size_t i = 0; i < blocks_.size(); ++i)
        for (size_t b = 0; b < blocks; ++b) {
            const size_t at = b * block_samples;
            if (may_change(knots_.row(i) + at, knots_.row(i + 1) + at, now + at, scale_[i], scale_[i + 1], &least_[at]))
                blocks_[i].push_back(uint32_t(b));
        }
}

template <typename Sum>
void FollowedBrightness<Sum>::apply(const Alignment::Place& place, RowBand<Sum>& band, size_t row) const {
    const size_t i = place.interval;
    follow({blocks_[i], knots_.row(i), knots_.row(i + 1), knots_.row(instant_), least_.data(), scale_[i], scale_[i + 1],
            std::clamp(place.fraction, 0.0f, 1.0f)},
           band.row(row));
}

template std::vector<float> relative_light(std::span<const RowBand<int16_t>>, size_t, const NoiseModel&);
template std::vector<float> relative_light(std::span<const RowBand<int32_t>>, size_t, const NoiseModel&);
template std::vector<float> relative_light(std::span<const RowBand<float>>, size_t, const NoiseModel&);
template class FollowedBrightness<int16_t>;
template class FollowedBrightness<int32_t>;
template class FollowedBrightness<float>;

}  // namespace ols
#endif
