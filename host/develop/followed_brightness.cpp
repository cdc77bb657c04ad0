// SPDX-License-Identifier: MIT
// Finds the blocks of samples that may change in each interval, once for all of its slots; the others are not touched.
#include "develop/followed_brightness.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <type_traits>

#include "demultiplex/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "develop/followed_brightness.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#include "develop/sample_lanes_inl.hpp"

#ifndef OLS_FOLLOWED_BRIGHTNESS_TYPES
#define OLS_FOLLOWED_BRIGHTNESS_TYPES
namespace ols {

constexpr size_t block_samples = 16;  // divides a cache line of any kind of sample: rows of a band are padded to lines

// A knot's tracking samples beside the target's own.
template <typename Sum>
struct Compared {
    const Sum *then, *now;
    float scale;         // brings `then` to the target's light
    const float* noise;  // the difference that noise may make; infinite where `now` is not known
};

// Of a camera, and how many of its deviations a difference may be.
struct AllowedNoise {
    float read, shot, moving, still;
};

// One interval, for a slot at a fraction of it.
struct Following {
    const std::vector<uint32_t>& blocks;
    const float *first, *last;  // divisors of the knots at its ends
    float fraction;
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The difference that noise may make; infinite where `now` is not known.
template <typename Sum>
void allow_in(const Sum* now, const uint8_t* moves, size_t count, const AllowedNoise& allowed, float* noise) {
    const Floats d;
    const hn::Rebind<uint8_t, Floats> d8;
    const Longs di;
    const auto read = hn::Set(d, allowed.read), shot = hn::Set(d, allowed.shot);
    const auto moving = hn::Set(d, allowed.moving), still = hn::Set(d, allowed.still);
    const auto unknown = hn::Set(d, std::numeric_limits<float>::infinity());
    for (size_t at = 0; at < count; at += hn::Lanes(d)) {
        const Samples sample = load(now + at);
        const auto sigma = hn::Add(read, hn::Mul(shot, hn::Sqrt(hn::Max(sample.value, hn::Zero(d)))));
        const auto is_moving = hn::Ne(hn::PromoteTo(di, hn::LoadU(d8, moves + at)), hn::Zero(di));
        const auto deviations = hn::IfThenElse(hn::RebindMask(d, is_moving), moving, still);
        hn::StoreU(hn::IfThenElse(sample.is_seen, hn::Mul(deviations, sigma), unknown), d, noise + at);
    }
}

// divisors = 1 / (1 + g (T0 / T - 1)). Marks the blocks where any may differ from 1.
template <typename Sum>
void compare_in(const Compared<Sum>& knot, size_t count, float* divisors, uint8_t* changes) {
    constexpr float largest_factor = 4;
    const Floats d;
    const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f), scale = hn::Set(d, knot.scale);
    const auto most = hn::Set(d, largest_factor), least = hn::Set(d, 1 / largest_factor);
    for (size_t at = 0; at < count; at += hn::Lanes(d)) {
        const Samples recorded = load(knot.then + at), now = load(knot.now + at);
        const auto then = hn::Mul(recorded.value, scale);
        const auto noise = hn::LoadU(d, knot.noise + at), difference = hn::Abs(hn::Sub(now.value, then));
        // NaN is not greater than anything.
        const auto differs = hn::And(hn::Gt(difference, noise), recorded.is_seen);
        const auto lit = hn::Max(now.value, zero);
        const auto quotient = hn::Min(hn::Max(hn::Div(lit, then), least), most);
        const auto factor =
            hn::IfThenElse(hn::Gt(then, zero), quotient, hn::IfThenElse(hn::Gt(lit, then), most, least));
        const auto noise_share = hn::Div(noise, difference);
        const auto gain = hn::Mul(hn::Sub(one, hn::Mul(noise_share, noise_share)), hn::Sub(factor, one));
        hn::StoreU(hn::IfThenElse(differs, hn::Div(one, hn::Add(one, gain)), one), d, divisors + at);
        changes[at / block_samples] |= uint8_t(!hn::AllFalse(d, differs));
    }
}

// samples /= the divisor in between
template <typename Sum>
void follow_in(const Following& following, Sum* samples) {
    const Floats d;
    const auto fraction = hn::Set(d, following.fraction);
    for (const uint32_t block : following.blocks)
        for (size_t at = block * block_samples; at < (block + 1) * block_samples; at += hn::Lanes(d)) {
            const auto first = hn::LoadU(d, following.first + at), last = hn::LoadU(d, following.last + at);
            const auto divisor = hn::Add(first, hn::Mul(fraction, hn::Sub(last, first)));
            const Samples sample = load(samples + at);
            store(sample.is_seen, hn::Div(sample.value, divisor), samples + at);
        }
}

#define OLS_FOR_KIND(kind, Sum)                                                                                        \
    void allow_##kind(const Sum* now, const uint8_t* moves, size_t count, const AllowedNoise& allowed, float* noise) { \
        allow_in(now, moves, count, allowed, noise);                                                                   \
    }                                                                                                                  \
    void compare_##kind(const Compared<Sum>& knot, size_t count, float* divisors, uint8_t* changes) {                  \
        compare_in(knot, count, divisors, changes);                                                                    \
    }                                                                                                                  \
    void follow_##kind(const Following& following, Sum* samples) {                                                     \
        follow_in(following, samples);                                                                                 \
    }
OLS_FOR_KIND(shorts, int16_t)
OLS_FOR_KIND(longs, int32_t)
OLS_FOR_KIND(floats, float)
#undef OLS_FOR_KIND

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(allow_shorts);
HWY_EXPORT(allow_longs);
HWY_EXPORT(allow_floats);
HWY_EXPORT(compare_shorts);
HWY_EXPORT(compare_longs);
HWY_EXPORT(compare_floats);
HWY_EXPORT(follow_shorts);
HWY_EXPORT(follow_longs);
HWY_EXPORT(follow_floats);

namespace {

// Of what noise makes of the difference: what is less is taken for noise.
constexpr double moving_deviations = 1.5, still_deviations = 6;

#define OLS_DISPATCH_KIND(kind, Sum)                                                                            \
    void allow(const Sum* now, const uint8_t* moves, size_t count, const AllowedNoise& allowed, float* noise) { \
        HWY_DYNAMIC_DISPATCH(allow_##kind)(now, moves, count, allowed, noise);                                  \
    }                                                                                                           \
    void compare(const Compared<Sum>& knot, size_t count, float* divisors, uint8_t* changes) {                  \
        HWY_DYNAMIC_DISPATCH(compare_##kind)(knot, count, divisors, changes);                                   \
    }                                                                                                           \
    void follow(const Following& following, Sum* samples) {                                                     \
        HWY_DYNAMIC_DISPATCH(follow_##kind)(following, samples);                                                \
    }
OLS_DISPATCH_KIND(shorts, int16_t)
OLS_DISPATCH_KIND(longs, int32_t)
OLS_DISPATCH_KIND(floats, float)
#undef OLS_DISPATCH_KIND

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
FollowedBrightness<Sum>::FollowedBrightness(const RowBand<Sum>& rows, const BrightnessKnots& knots,
                                            const NoiseModel& noise, std::span<const uint8_t> moves)
    : ticks_(knots.ticks), divisors_(rows.rows()), blocks_(rows.rows() - 1) {
    const auto& [ticks, light, instant] = knots;
    assert(rows.rows() == ticks.size() && ticks.size() >= 2);
    const size_t samples = rows.masked.size(), blocks = (samples + block_samples - 1) / block_samples;
    const Sum* const now = rows.row(instant);
    const size_t padded = blocks * block_samples;
    std::vector<uint8_t> is_moving(moves.begin(), moves.end());
    is_moving.resize(padded);
    std::vector<float> allowed(padded);
    allow(now, is_moving.data(), padded,
          {float(noise.read_counts), float(noise.shot), float(moving_deviations * M_SQRT2),
           float(still_deviations * M_SQRT2)},
          allowed.data());
    std::fill(allowed.begin() + std::ptrdiff_t(samples), allowed.end(), std::numeric_limits<float>::infinity());
    std::vector<std::vector<uint8_t>> changes(divisors_.size(), std::vector<uint8_t>(blocks));  // by knot
    for (size_t k = 0; k < divisors_.size(); ++k) {
        divisors_[k].assign(padded, 1.0f);
        if (k != instant)
            compare({rows.row(k), now, 1 / light[k], allowed.data()}, padded, divisors_[k].data(), changes[k].data());
    }
    for (size_t i = 0; i < blocks_.size(); ++i)
        for (size_t b = 0; b < blocks; ++b)
            if (changes[i][b] || changes[i + 1][b]) blocks_[i].push_back(uint32_t(b));
}

template <typename Sum>
void FollowedBrightness<Sum>::apply(double tick, Sum* samples) const {
    size_t i = 0;
    while (i + 1 < blocks_.size() && ticks_[i + 1] <= tick) ++i;
    const auto fraction = float((tick - ticks_[i]) / (ticks_[i + 1] - ticks_[i]));
    follow({blocks_[i], divisors_[i].data(), divisors_[i + 1].data(), std::clamp(fraction, 0.0f, 1.0f)}, samples);
}

template std::vector<float> relative_light(std::span<const RowBand<int16_t>>, size_t, const NoiseModel&);
template std::vector<float> relative_light(std::span<const RowBand<int32_t>>, size_t, const NoiseModel&);
template std::vector<float> relative_light(std::span<const RowBand<float>>, size_t, const NoiseModel&);
template class FollowedBrightness<int16_t>;
template class FollowedBrightness<int32_t>;
template class FollowedBrightness<float>;

}  // namespace ols
#endif
