// SPDX-License-Identifier: MIT
// Eight target pixels at a time: their sources mostly lie within sixteen pixels of two or three rows, which fit registers, so
// that the gather is a byte shuffle. Where motion is wilder than that, a pixel at a time, by the same arithmetic.
#include "reflectance/warp.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "reflectance/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reflectance/warp.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int at_once = 8;        // target pixels
constexpr int table_pixels = 16;  // of a source row, in two registers
constexpr int table_slack = 3;    // of these before the first pixel's source
constexpr int one_log2 = 15;      // weights are in units of 2^-15
constexpr int16_t masked = masked_sample<int16_t>;

// Sources of eight pixels: whole pixels and weights.
struct Sources {
    alignas(16) int16_t x[at_once], y[at_once], fx[at_once], fy[at_once];
    alignas(16) int16_t outside[at_once];  // -1 or 0
};

// `precision` extra bits while interpolating; |a - b| << precision must fit int16.
HWY_INLINE int16_t lerp(int16_t a, int16_t b, int16_t weight) {
    return int16_t(a + ((int32_t(b - a) * weight + (1 << (one_log2 - 1))) >> one_log2));
}

HWY_INLINE int16_t pixel(const CountPlane& source, const Sources& s, int k, int precision) {
    if (s.outside[k]) return masked;
    const int right = s.fx[k] ? std::min(s.x[k] + 1, source.width - 1) : s.x[k];
    const int below = s.fy[k] ? std::min(s.y[k] + 1, source.height - 1) : s.y[k];
    const int16_t* top = source.counts + size_t(s.y[k]) * source.pitch;
    const int16_t* bottom = source.counts + size_t(below) * source.pitch;
    const int16_t c[4] = {top[s.x[k]], top[right], bottom[s.x[k]], bottom[right]};
    if (std::min({c[0], c[1], c[2], c[3]}) == masked) return masked;
    const auto fine = [&](int16_t v) { return int16_t(v * (1 << precision)); };
    const int16_t upper = lerp(fine(c[0]), fine(c[1]), s.fx[k]), lower = lerp(fine(c[2]), fine(c[3]), s.fx[k]);
    return int16_t((lerp(upper, lower, s.fy[k]) + (1 << precision >> 1)) >> precision);
}

#if HWY_TARGET != HWY_SCALAR

using D16 = hn::FixedTag<int16_t, at_once>;
using V16 = hn::Vec<D16>;
using M16 = hn::Mask<D16>;

// The counts of one source row that eight pixels need: at x and at x + 1.
struct RowTaps {
    V16 left, right;
};

HWY_INLINE V16 look_up(V16 first, V16 second, V16 bytes) {
    const D16 d;
    const hn::Repartition<uint8_t, D16> d8;
    // TableLookupBytesOr0 gives 0 where the top bit is set and counts modulo 16 else.
    const auto in_first = hn::Add(hn::BitCast(d8, bytes), hn::Set(d8, 0x70));
    const auto in_second = hn::Sub(hn::BitCast(d8, bytes), hn::Set(d8, 16));
    return hn::Or(hn::BitCast(d, hn::TableLookupBytesOr0(hn::BitCast(d8, first), in_first)),
                  hn::BitCast(d, hn::TableLookupBytesOr0(hn::BitCast(d8, second), in_second)));
}

HWY_INLINE RowTaps taps(const int16_t* row, V16 left_bytes, V16 right_bytes) {
    const D16 d;
    const V16 first = hn::LoadU(d, row), second = hn::LoadU(d, row + at_once);
    return {look_up(first, second, left_bytes), look_up(first, second, right_bytes)};
}

template <int precision>
HWY_INLINE V16 across(RowTaps row, V16 weight) {
    const V16 left = hn::ShiftLeft<precision>(row.left), right = hn::ShiftLeft<precision>(row.right);
    return hn::Add(left, hn::MulFixedPoint15(hn::Sub(right, left), weight));
}

// Eight pixels whose sources fit the table: columns from `base_x`, rows base_y to base_y + 2.
template <int precision>
HWY_INLINE void eight(const CountPlane& source, const Sources& s, V16 x, V16 next_x, V16 y, int base_x, int base_y,
                      int16_t* out) {
    const D16 d;
    const V16 fx = hn::Load(d, s.fx), fy = hn::Load(d, s.fy);
    const M16 whole_x = hn::Eq(fx, hn::Zero(d)), whole_y = hn::Eq(fy, hn::Zero(d));
    const V16 next = hn::IfThenElse(whole_x, x, next_x);
    // Lane 2 x in the lower byte, 2 x + 1 in the upper.
    const auto bytes_of = [&](V16 lane)
                              HWY_ATTR { return hn::Add(hn::Mul(lane, hn::Set(d, 0x0202)), hn::Set(d, 0x0100)); };
    const V16 left = bytes_of(x), right = bytes_of(next);
    const auto row_taps = [&](int at) HWY_ATTR {
        return taps(source.counts + size_t(std::min(at, source.height - 1)) * source.pitch + base_x, left, right);
    };
    RowTaps top = row_taps(base_y), bottom = row_taps(base_y + 1);
    const M16 lower_rows = hn::Ne(y, hn::Zero(d));
    if (!hn::AllFalse(d, lower_rows)) {
        const RowTaps third = row_taps(base_y + 2);
        top = {hn::IfThenElse(lower_rows, bottom.left, top.left), hn::IfThenElse(lower_rows, bottom.right, top.right)};
        bottom = {hn::IfThenElse(lower_rows, third.left, bottom.left),
                  hn::IfThenElse(lower_rows, third.right, bottom.right)};
    }
    bottom = {hn::IfThenElse(whole_y, top.left, bottom.left), hn::IfThenElse(whole_y, top.right, bottom.right)};
    const V16 least = hn::Min(hn::Min(top.left, top.right), hn::Min(bottom.left, bottom.right));
    const V16 none = hn::Set(d, masked);
    const V16 upper = across<precision>(top, fx), lower = across<precision>(bottom, fx);
    V16 sum = hn::Add(upper, hn::MulFixedPoint15(hn::Sub(lower, upper), fy));
    if constexpr (precision > 0) sum = hn::ShiftRight<precision>(hn::Add(sum, hn::Set(d, 1 << precision >> 1)));
    const V16 gone = hn::Or(hn::VecFromMask(d, hn::Eq(least, none)), hn::Load(d, s.outside));
    hn::StoreU(hn::IfThenElse(hn::MaskFromVec(gone), none, sum), d, out);
}

// Positions of the pixels from `first` of one row, as whole pixels and weights; `at` counts from the field's begin.
HWY_INLINE void find_sources(const CountPlane& source, const SlotMotion& motion, int x, int y, size_t at, Sources& s) {
    const hn::CappedTag<float, at_once> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const auto part = [&](auto coordinate, int size, int16_t* whole, int16_t* weight) HWY_ATTR {
        const auto most = hn::Set(df, float(size - 1)), zero = hn::Zero(df);
        const auto held = hn::Min(hn::Max(coordinate, zero), most);
        const auto at_pixel = hn::ConvertTo(di, held);
        const auto fraction = hn::Sub(held, hn::ConvertTo(df, at_pixel));
        hn::StoreU(hn::DemoteTo(d16, at_pixel), d16, whole);
        const auto units = hn::NearestInt(hn::Mul(fraction, hn::Set(df, float(1 << one_log2))));
        hn::StoreU(hn::DemoteTo(d16, units), d16, weight);  // saturates
        return hn::Not(hn::Eq(held, coordinate));           // NaN is outside, too
    };
    for (int k = 0; k < at_once; k += int(hn::Lanes(df))) {
        const size_t from = at + size_t(k);
        const auto fraction = hn::Set(df, motion.fraction);
        const auto u =
            hn::Add(hn::LoadU(df, &motion.base->u[from]), hn::Mul(fraction, hn::LoadU(df, &motion.step->u[from])));
        const auto v =
            hn::Add(hn::LoadU(df, &motion.base->v[from]), hn::Mul(fraction, hn::LoadU(df, &motion.step->v[from])));
        const auto out_x = part(hn::Add(hn::Iota(df, float(x + k)), u), source.width, s.x + k, s.fx + k);
        const auto out_y = part(hn::Add(hn::Set(df, float(y)), v), source.height, s.y + k, s.fy + k);
        const auto outside = hn::VecFromMask(di, hn::RebindMask(di, hn::Or(out_x, out_y)));
        hn::StoreU(hn::DemoteTo(d16, outside), d16, s.outside + k);
    }
}

template <int precision>
void warp_rows(const CountPlane& source, const SlotMotion& motion, int16_t* out, size_t out_pitch) {
    const D16 d;
    const int width = motion.base->width, height = motion.base->height;
    Sources s;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; x += at_once) {
            const int begin = std::min(x, width - at_once);  // the last eight may overlap those before
            int16_t* const to = out + size_t(y) * out_pitch + size_t(begin);
            find_sources(source, motion, begin, y, size_t(y) * size_t(width) + size_t(begin), s);
            // Motion is smooth: the first pixel tells where the others are, mostly.
            const int base_x = std::clamp(s.x[0] - table_slack, 0, source.width - table_pixels);
            const int base_y = std::min(s.y[0], s.y[at_once - 1]);
            const V16 column = hn::Sub(hn::Load(d, s.x), hn::Set(d, int16_t(base_x)));
            const V16 row = hn::Sub(hn::Load(d, s.y), hn::Set(d, int16_t(base_y)));
            const V16 next = hn::Min(hn::Add(column, hn::Set(d, 1)), hn::Set(d, int16_t(source.width - 1 - base_x)));
            const V16 beyond = hn::Or(hn::AndNot(hn::Set(d, table_pixels - 1), hn::Or(column, next)),
                                      hn::AndNot(hn::Set(d, 1), row));  // negative ones have high bits, too
            if (hn::AllTrue(d, hn::Eq(beyond, hn::Zero(d))))
                eight<precision>(source, s, column, next, row, base_x, base_y, to);
            else
                for (int k = 0; k < at_once; ++k) to[k] = pixel(source, s, k, precision);
        }
}

#endif  // HWY_TARGET != HWY_SCALAR

// Planes too narrow for the table, and processors without one.
void warp_narrow(const CountPlane& source, const SlotMotion& motion, int precision, int16_t* out, size_t out_pitch) {
    const FlowField &base = *motion.base, &step = *motion.step;
    const auto part = [](float coordinate, int size, int16_t& whole, int16_t& weight) {
        const float held = std::min(std::max(coordinate, 0.0f), float(size - 1));
        whole = int16_t(held);
        weight = int16_t(std::min(std::nearbyint((held - float(whole)) * float(1 << one_log2)), 32767.0f));
        return held != coordinate;
    };
    Sources s;
    for (int y = 0; y < base.height; ++y)
        for (int x = 0; x < base.width; ++x) {
            const size_t at = size_t(y) * size_t(base.width) + size_t(x);
            const bool out_x =
                part(float(x) + (base.u[at] + motion.fraction * step.u[at]), source.width, s.x[0], s.fx[0]);
            const bool out_y =
                part(float(y) + (base.v[at] + motion.fraction * step.v[at]), source.height, s.y[0], s.fy[0]);
            s.outside[0] = out_x || out_y ? -1 : 0;
            out[size_t(y) * out_pitch + size_t(x)] = pixel(source, s, 0, precision);
        }
}

void warp_plane(const CountPlane& source, const SlotMotion& motion, int16_t* out, size_t out_pitch) {
    constexpr int fine_largest = 4095, fine_bits = 2;
    const bool is_fine = source.largest <= fine_largest;
#if HWY_TARGET != HWY_SCALAR
    if (source.width >= table_pixels)
        return is_fine ? warp_rows<fine_bits>(source, motion, out, out_pitch)
                       : warp_rows<0>(source, motion, out, out_pitch);
#endif
    warp_narrow(source, motion, is_fine ? fine_bits : 0, out, out_pitch);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(warp_plane);

FlowField seen_from_target(const FlowField& base, const FlowField& local) {
    FlowField seen = concatenated(base, local);
    for (size_t p = 0; p < seen.size(); ++p) seen.u[p] -= base.u[p], seen.v[p] -= base.v[p];
    return seen;
}

FlowField of_color_plane(const FlowField& flow, int first_x, int first_y) {
    FlowField out((flow.width - first_x + 1) / 2, (flow.height - first_y + 1) / 2);
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            const size_t from = size_t(2 * y + first_y) * size_t(flow.width) + size_t(2 * x + first_x);
            const size_t to = size_t(y) * size_t(out.width) + size_t(x);
            out.u[to] = flow.u[from] / 2;
            out.v[to] = flow.v[from] / 2;
        }
    return out;
}

void warp_counts(const CountPlane& source, const SlotMotion& motion, int16_t* out, size_t out_pitch) {
    assert(source.counts && source.largest <= 16383 && motion.base && motion.step);
    assert(motion.base->width == source.width && motion.base->height == source.height);
    assert(motion.step->width == source.width && motion.step->height == source.height);
    HWY_DYNAMIC_DISPATCH(warp_plane)(source, motion, out, out_pitch);
}

}  // namespace ols
#endif
