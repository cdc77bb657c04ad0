// SPDX-License-Identifier: MIT
// Cubic convolution, some pixels at a time: positions of a whole row first, then sixteen taps each, gathered two to a word.
#include "reflectance/warp.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

#include "reflectance/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reflectance/warp_cubic.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Pixels begin ... end - 1 of a row whose taps all lie inside and are no masked ones; gives the first that is not so, or end.
size_t cubic_run(const CountPlane& source, const float* at_x, const float* at_y, size_t begin, size_t end,
                 int16_t* out) {
#if HWY_TARGET == HWY_SCALAR
    (void)source, (void)at_x, (void)at_y, (void)end, (void)out;
    return begin;
#else
    const hn::ScalableTag<float> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const size_t lanes = hn::Lanes(df);
    const auto set = [&](float v) HWY_ATTR { return hn::Set(df, v); };
    const auto weights = [&](auto t, auto(&w)[4]) HWY_ATTR {
        const auto t2 = hn::Mul(t, t), half = set(0.5f);
        w[0] = hn::Mul(t, hn::Sub(hn::Mul(t, hn::Sub(set(1), hn::Mul(half, t))), half));
        w[1] = hn::Add(hn::Mul(t2, hn::Sub(hn::Mul(set(1.5f), t), set(2.5f))), set(1));
        w[2] = hn::Mul(t, hn::Add(hn::Mul(t, hn::Sub(set(2), hn::Mul(set(1.5f), t))), half));
        w[3] = hn::Mul(t2, hn::Sub(hn::Mul(half, t), half));
    };
    for (; begin + lanes <= end; begin += lanes) {
        const auto x = hn::LoadU(df, at_x + begin), y = hn::LoadU(df, at_y + begin);
        const auto inside = hn::And(hn::And(hn::Ge(x, set(1)), hn::Lt(x, set(float(source.width - 2)))),
                                    hn::And(hn::Ge(y, set(1)), hn::Lt(y, set(float(source.height - 2)))));
        if (!hn::AllTrue(df, inside)) return begin;
        const auto left = hn::ConvertTo(di, x), above = hn::ConvertTo(di, y);
        const auto fx = hn::Sub(x, hn::ConvertTo(df, left)), fy = hn::Sub(y, hn::ConvertTo(df, above));
        auto offset =
            hn::ShiftLeft<1>(hn::Add(hn::Mul(hn::Sub(above, hn::Set(di, 1)), hn::Set(di, int32_t(source.pitch))),
                                     hn::Sub(left, hn::Set(di, 1))));
        hn::Vec<decltype(df)> wx[4], wy[4];
        weights(fx, wx);
        weights(fy, wy);
        auto sum = hn::Zero(df);
        auto masked = hn::FirstN(di, 0);
        for (int j = 0; j < 4; ++j) {
            const auto* const words = reinterpret_cast<const int32_t*>(source.counts);
            const auto two = hn::GatherOffset(di, words, offset);
            const auto more = hn::GatherOffset(di, words, hn::Add(offset, hn::Set(di, 4)));
            const auto low = [&](auto word) HWY_ATTR { return hn::ShiftRight<16>(hn::ShiftLeft<16>(word)); };
            const auto high = [&](auto word) HWY_ATTR { return hn::ShiftRight<16>(word); };
            const decltype(two) taps[4] = {low(two), high(two), low(more), high(more)};
            auto across = hn::Zero(df);
            for (int i = 0; i < 4; ++i) {
                masked = hn::Or(masked, hn::Eq(taps[i], hn::Set(di, masked_sample<int16_t>)));
                across = hn::Add(across, hn::Mul(wx[i], hn::ConvertTo(df, taps[i])));
            }
            sum = hn::Add(sum, hn::Mul(wy[j], across));
            offset = hn::Add(offset, hn::Set(di, int32_t(2 * source.pitch)));
        }
        if (!hn::AllFalse(di, masked)) return begin;
        const auto held = hn::Min(hn::Max(sum, set(-32767)), set(32767));
        hn::StoreU(hn::DemoteTo(d16, hn::NearestInt(held)), d16, out + begin);
    }
    return begin;
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(cubic_run);

namespace {

// Keys 1981, equation 15 with a = -1/2, for the samples at -1, 0, 1, 2 from a fraction t: exact for quadratics.
void cubic_weights(float t, float (&w)[4]) {
    w[0] = t * (t * (1 - 0.5f * t) - 0.5f);
    w[1] = t * t * (1.5f * t - 2.5f) + 1;
    w[2] = t * (t * (2 - 1.5f * t) + 0.5f);
    w[3] = t * t * (0.5f * t - 0.5f);
}

float lerp(float a, float b, float weight) {
    return (1 - weight) * a + weight * b;
}

// One pixel, by the rules of warp_counts(); NaN where it is masked.
template <typename PlaneOf, typename Sample>
float cubic_pixel(const PlaneOf& source, const Sample* samples, float x, float y) {
    constexpr float none = std::numeric_limits<float>::quiet_NaN();
    if (std::isnan(x) || std::isnan(y)) return none;
    const float held_x = std::clamp(x, 0.0f, float(source.width - 1)),
                held_y = std::clamp(y, 0.0f, float(source.height - 1));
    if (!source.holds_edges && (held_x != x || held_y != y)) return none;
    const int left = int(held_x), above = int(held_y);
    const float fx = held_x - float(left), fy = held_y - float(above);
    const auto tap = [&](int i, int j) {
        const size_t row = size_t(std::clamp(above + j, 0, source.height - 1)) * source.pitch;
        const Sample v = samples[row + size_t(std::clamp(left + i, 0, source.width - 1))];
        return is_masked(v) || !std::isfinite(float(v)) ? none : float(v);
    };
    if (fx == 0 && fy == 0) return tap(0, 0);
    float wx[4], wy[4], sum = 0;
    cubic_weights(fx, wx);
    cubic_weights(fy, wy);
    for (int j = 0; j < 4; ++j) {
        float across = 0;
        for (int i = 0; i < 4; ++i) across += wx[i] * tap(i - 1, j - 1);
        sum += wy[j] * across;
    }
    if (!std::isnan(sum)) return sum;
    const int right = fx > 0 ? 1 : 0, below = fy > 0 ? 1 : 0;
    return lerp(lerp(tap(0, 0), tap(right, 0), fx), lerp(tap(0, below), tap(right, below), fx), fy);
}

int16_t to_counts(float value) {
    if (std::isnan(value)) return masked_sample<int16_t>;
    return int16_t(std::nearbyint(std::clamp(value, -32767.0f, 32767.0f)));
}

}  // namespace

void warp_counts_cubic(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                       int16_t* out, size_t out_pitch) {
    assert(source.counts && motion.width() == source.width && motion.height() == source.height);
    const auto width = size_t(source.width);
    std::vector<float> at_x(width), at_y(width);
    for (int row = 0; row < range.count; ++row) {
        motion.positions(range.first + row, fraction, at_x.data(), at_y.data());
        int16_t* const to = out + size_t(row) * out_pitch;
        for (size_t x = 0; x < width;) {
            const size_t reached = HWY_DYNAMIC_DISPATCH(cubic_run)(source, at_x.data(), at_y.data(), x, width, to);
            const size_t alone = std::min(reached + 16, width);  // past what stopped it, on any path
            for (x = reached; x < alone; ++x) to[x] = to_counts(cubic_pixel(source, source.counts, at_x[x], at_y[x]));
        }
    }
}

void warp_samples_cubic(const SamplePlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                        float* out, size_t out_pitch) {
    assert(source.samples && motion.width() == source.width && motion.height() == source.height);
    const auto width = size_t(source.width);
    std::vector<float> at_x(width), at_y(width);
    for (int row = 0; row < range.count; ++row) {
        motion.positions(range.first + row, fraction, at_x.data(), at_y.data());
        float* const to = out + size_t(row) * out_pitch;
        for (size_t x = 0; x < width; ++x) to[x] = cubic_pixel(source, source.samples, at_x[x], at_y[x]);
    }
}

}  // namespace ols
#endif
