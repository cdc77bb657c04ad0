// SPDX-License-Identifier: MIT
// Eight target pixels at a time: their sources mostly lie within sixteen pixels of two or three rows, which fit registers, so
// that the gather is a byte shuffle. Where motion is wilder than that, a pixel at a time, by the same arithmetic.
#include "reflectance/warp.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

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

// Where eight pixels whose sources fit the table have them: columns from `base_x` with the next ones, rows from `base_y`
// (0 or 1), weights, and -1 where they are outside.
struct Shuffled {
    int base_x, base_y;
    V16 x, next_x, y, fx, fy, outside;
};

template <int precision>
HWY_INLINE void eight(const CountPlane& source, const Shuffled& s, int16_t* out) {
    const D16 d;
    const V16 fx = s.fx, fy = s.fy;
    const M16 whole_x = hn::Eq(fx, hn::Zero(d)), whole_y = hn::Eq(fy, hn::Zero(d));
    const V16 next = hn::IfThenElse(whole_x, s.x, s.next_x);
    // Lane 2 x in the lower byte, 2 x + 1 in the upper.
    const auto bytes_of = [&](V16 lane)
                              HWY_ATTR { return hn::Add(hn::Mul(lane, hn::Set(d, 0x0202)), hn::Set(d, 0x0100)); };
    const V16 left = bytes_of(s.x), right = bytes_of(next);
    const auto row_taps = [&](int at) HWY_ATTR {
        return taps(source.counts + size_t(std::min(at, source.height - 1)) * source.pitch + size_t(s.base_x), left,
                    right);
    };
    RowTaps top = row_taps(s.base_y), bottom = row_taps(s.base_y + 1);
    const M16 lower_rows = hn::Ne(s.y, hn::Zero(d));
    if (!hn::AllFalse(d, lower_rows)) {
        const RowTaps third = row_taps(s.base_y + 2);
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
    const V16 gone = hn::Or(hn::VecFromMask(d, hn::Eq(least, none)), s.outside);
    hn::StoreU(hn::IfThenElse(hn::MaskFromVec(gone), none, sum), d, out);
}

// Positions of eight pixels from (x, y), as whole pixels and weights.
HWY_INLINE void find_sources(const CountPlane& source, const GroupMotion& motion, float fraction_of_step, int x, int y,
                             Sources& s) {
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
        const size_t from = size_t(y) * size_t(motion.width()) + size_t(x + k);
        const auto fraction = hn::Set(df, fraction_of_step);
        const auto vector = [&](const std::vector<float>& base, const std::vector<float>& step) HWY_ATTR {
            return hn::Add(hn::LoadU(df, &base[from]), hn::Mul(fraction, hn::LoadU(df, &step[from])));
        };
        const auto u = vector(motion.base().u, motion.step().u), v = vector(motion.base().v, motion.step().v);
        const auto out_x = part(hn::Add(hn::Iota(df, float(x + k)), u), source.width, s.x + k, s.fx + k);
        const auto out_y = part(hn::Add(hn::Set(df, float(y)), v), source.height, s.y + k, s.fy + k);
        const auto outside = hn::VecFromMask(di, hn::RebindMask(di, hn::Or(out_x, out_y)));
        hn::StoreU(hn::DemoteTo(d16, outside), d16, s.outside + k);
    }
}

// Eight pixels with vectors of their own.
template <int precision>
void warp_pixels(const CountPlane& source, const GroupMotion& motion, float fraction, int x, int y, int16_t* out) {
    const D16 d;
    Sources s;
    find_sources(source, motion, fraction, x, y, s);
    // Motion is smooth: the first pixel tells where the others are, mostly.
    const int base_x = std::clamp(s.x[0] - table_slack, 0, source.width - table_pixels);
    const int base_y = std::min(s.y[0], s.y[at_once - 1]);
    const V16 column = hn::Sub(hn::Load(d, s.x), hn::Set(d, int16_t(base_x)));
    const V16 row = hn::Sub(hn::Load(d, s.y), hn::Set(d, int16_t(base_y)));
    const V16 next = hn::Min(hn::Add(column, hn::Set(d, 1)), hn::Set(d, int16_t(source.width - 1 - base_x)));
    const V16 beyond = hn::Or(hn::AndNot(hn::Set(d, table_pixels - 1), hn::Or(column, next)),
                              hn::AndNot(hn::Set(d, 1), row));  // negative ones have high bits, too
    if (hn::AllTrue(d, hn::Eq(beyond, hn::Zero(d))))
        return eight<precision>(
            source, {base_x, base_y, column, next, row, hn::Load(d, s.fx), hn::Load(d, s.fy), hn::Load(d, s.outside)},
            out);
    for (int k = 0; k < at_once; ++k) out[k] = pixel(source, s, k, precision);
}

// Runs of one row that lie on lines, in units of 2^-11 pixels: relative to whole base pixels, what fits int16.
constexpr int line_log2 = 11;
constexpr int slope_log2 = 13;  // two more bits for what is multiplied by seven
struct LineRow {
    std::vector<int32_t> base_x, x, dx, base_y, y, dy;  // x, y: of the first pixel, less the base; dx, dy: less 1, 0
    std::vector<int32_t> fits;                          // not 0: on a line, inside the plane, within the table

    explicit LineRow(int runs) {
        for (auto* list : {&base_x, &x, &dx, &base_y, &y, &dy, &fits}) list->resize(size_t(runs) + 16);
    }
};

void find_lines(const CountPlane& source, const GroupMotion& motion, float fraction, int y, LineRow& row) {
    const hn::CappedTag<float, 16> df;
    const hn::RebindToSigned<decltype(df)> di;
    const int runs = motion.runs();
    const GroupMotion::Lines& lines = motion.lines();
    const auto step_share = hn::Set(df, fraction), unit = hn::Set(df, float(1 << line_log2)),
               slope_unit = hn::Set(df, float(1 << slope_log2));
    const auto last = hn::Set(di, at_once - 1), low = hn::Set(di, (1 << line_log2) - 1);
    for (int r = 0; r < runs; r += int(hn::Lanes(df))) {
        const size_t from = size_t(y) * size_t(runs) + size_t(r);
        const auto vector = [&](const std::vector<float>& base, const std::vector<float>& step) HWY_ATTR {
            return hn::Add(hn::LoadU(df, &base[from]), hn::Mul(step_share, hn::LoadU(df, &step[from])));
        };
        const auto fixed = [&](auto pixels, auto per_pixel)
                               HWY_ATTR { return hn::NearestInt(hn::Mul(pixels, per_pixel)); };
        const auto first_x = hn::Mul(hn::Iota(df, float(r)), hn::Set(df, float(at_once)));
        const auto u = hn::Add(first_x, vector(lines.base_u, lines.step_u));
        const auto v = hn::Add(hn::Set(df, float(y)), vector(lines.base_v, lines.step_v));
        const auto du = vector(lines.base_du, lines.step_du);
        const auto dv = vector(lines.base_dv, lines.step_dv);
        const auto x = fixed(u, unit), dx = fixed(du, slope_unit), at_y = fixed(v, unit), dy = fixed(dv, slope_unit);
        const auto reach = [&](auto slope)
                               HWY_ATTR { return hn::ShiftRight<slope_log2 - line_log2>(hn::Mul(slope, last)); };
        const auto end_x = hn::Add(hn::Add(x, hn::Set(di, (at_once - 1) << line_log2)), reach(dx));
        const auto end_y = hn::Add(at_y, reach(dy));
        const auto least_y = hn::Min(at_y, end_y), most_y = hn::Max(at_y, end_y);
        const auto base_x = hn::ShiftRight<line_log2>(x), base_y = hn::ShiftRight<line_log2>(least_y);
        hn::StoreU(base_x, di, &row.base_x[size_t(r)]);
        hn::StoreU(hn::And(x, low), di, &row.x[size_t(r)]);
        hn::StoreU(dx, di, &row.dx[size_t(r)]);
        hn::StoreU(base_y, di, &row.base_y[size_t(r)]);
        hn::StoreU(hn::Sub(at_y, hn::ShiftLeft<line_log2>(base_y)), di, &row.y[size_t(r)]);
        hn::StoreU(dy, di, &row.dy[size_t(r)]);
        // Where it is no line the vectors are NaN, which equals nothing; huge ones would overflow.
        const auto limit = hn::Set(df, 30000.0f);
        const auto is_line = hn::And(hn::Eq(u, u), hn::And(hn::Lt(hn::Abs(u), limit), hn::Lt(hn::Abs(v), limit)));
        auto fits = hn::VecFromMask(di, hn::RebindMask(di, is_line));
        const auto require = [&](auto condition) HWY_ATTR { fits = hn::And(fits, hn::VecFromMask(di, condition)); };
        const auto none = hn::Set(di, -1);

        require(hn::Lt(hn::Abs(dx), hn::Set(di, 1 << (slope_log2 - 1))));
        require(hn::Lt(hn::Abs(dy), hn::Set(di, 1 << (slope_log2 - 1))));
        require(hn::Gt(x, none));
        require(hn::Lt(base_x, hn::Set(di, source.width - table_pixels + 1)));
        require(hn::Lt(end_x, hn::Set(di, (source.width - 1) << line_log2)));
        require(hn::Gt(least_y, none));
        require(hn::Lt(most_y, hn::Set(di, (source.height - 1) << line_log2)));
        require(hn::Lt(hn::ShiftRight<line_log2>(most_y), hn::Add(base_y, hn::Set(di, 2))));
        hn::StoreU(fits, di, &row.fits[size_t(r)]);
    }
}

template <int precision>
HWY_INLINE void warp_line(const CountPlane& source, const LineRow& row, size_t r, int16_t* out) {
    const D16 d;
    const V16 steps = hn::Iota(d, 0), low = hn::Set(d, (1 << line_log2) - 1);
    const auto along = [&](int32_t slope) HWY_ATTR {
        return hn::ShiftRight<slope_log2 - line_log2>(hn::Mul(steps, hn::Set(d, int16_t(slope))));
    };
    const V16 x = hn::Add(hn::Add(hn::Set(d, int16_t(row.x[r])), hn::ShiftLeft<line_log2>(steps)), along(row.dx[r]));
    const V16 y = hn::Add(hn::Set(d, int16_t(row.y[r])), along(row.dy[r]));
    const V16 column = hn::ShiftRight<line_log2>(x);
    eight<precision>(source,
                     {row.base_x[r], row.base_y[r], column, hn::Add(column, hn::Set(d, 1)),
                      hn::ShiftRight<line_log2>(y), hn::ShiftLeft<one_log2 - line_log2>(hn::And(x, low)),
                      hn::ShiftLeft<one_log2 - line_log2>(hn::And(y, low)), hn::Zero(d)},
                     out);
}

template <int precision>
void warp_rows(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range, int16_t* out,
               size_t out_pitch) {
    const int width = motion.width(), runs = motion.runs();
    LineRow row(runs);
    for (int y = range.first; y < range.first + range.count; ++y) {
        int16_t* const to = out + size_t(y - range.first) * out_pitch;
        find_lines(source, motion, fraction, y, row);
        for (int r = 0; r < runs; ++r) {
            if (row.fits[size_t(r)])
                warp_line<precision>(source, row, size_t(r), to + r * at_once);
            else
                warp_pixels<precision>(source, motion, fraction, r * at_once, y, to + r * at_once);
        }
        // The last eight overlap those before.
        if (width % at_once) warp_pixels<precision>(source, motion, fraction, width - at_once, y, to + width - at_once);
    }
}

#endif  // HWY_TARGET != HWY_SCALAR

// Planes too narrow for the table, and processors without one.
void warp_narrow(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                 int precision, int16_t* out, size_t out_pitch) {
    const FlowField &base = motion.base(), &step = motion.step();
    const auto part = [](float coordinate, int size, int16_t& whole, int16_t& weight) {
        const float held = std::min(std::max(coordinate, 0.0f), float(size - 1));
        whole = int16_t(held);
        weight = int16_t(std::min(std::nearbyint((held - float(whole)) * float(1 << one_log2)), 32767.0f));
        return held != coordinate;
    };
    Sources s;
    for (int y = range.first; y < range.first + range.count; ++y)
        for (int x = 0; x < base.width; ++x) {
            const size_t at = size_t(y) * size_t(base.width) + size_t(x);
            const bool out_x = part(float(x) + (base.u[at] + fraction * step.u[at]), source.width, s.x[0], s.fx[0]);
            const bool out_y = part(float(y) + (base.v[at] + fraction * step.v[at]), source.height, s.y[0], s.fy[0]);
            s.outside[0] = out_x || out_y ? -1 : 0;
            out[size_t(y - range.first) * out_pitch + size_t(x)] = pixel(source, s, 0, precision);
        }
}

void warp_range(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                int16_t* out, size_t out_pitch) {
    constexpr int fine_largest = 4095, fine_bits = 2;
    const bool is_fine = source.largest <= fine_largest;
#if HWY_TARGET != HWY_SCALAR
    if (source.width >= table_pixels)
        return is_fine ? warp_rows<fine_bits>(source, motion, fraction, range, out, out_pitch)
                       : warp_rows<0>(source, motion, fraction, range, out, out_pitch);
#endif
    warp_narrow(source, motion, fraction, range, is_fine ? fine_bits : 0, out, out_pitch);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(warp_range);

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

GroupMotion::GroupMotion(FlowField base, FlowField step, float tolerance_px)
    : base_(std::move(base)), step_(std::move(step)) {
    assert(base_.width == step_.width && base_.height == step_.height);
    const size_t count = size_t(runs()) * size_t(height());
    // Vectors read whole registers.
    for (auto* list : {&lines_.base_u, &lines_.base_du, &lines_.base_v, &lines_.base_dv, &lines_.step_u,
                       &lines_.step_du, &lines_.step_v, &lines_.step_dv})
        list->assign(count + 16, std::numeric_limits<float>::quiet_NaN());
    // The line through the first and the last pixel; whether the others are near it.
    const auto fit = [&](const float* v, float& first, float& change) {
        first = v[0];
        change = (v[run_pixels - 1] - v[0]) / float(run_pixels - 1);
        float worst = 0;
        for (int k = 1; k < run_pixels - 1; ++k) worst = std::max(worst, std::abs(v[0] + float(k) * change - v[k]));
        return worst <= tolerance_px / 2;  // base and step share the tolerance
    };
    for (size_t run = 0; run < count; ++run) {
        const size_t at = run / size_t(runs()) * size_t(width()) + run % size_t(runs()) * run_pixels;
        bool ok = tolerance_px > 0;
        ok &= fit(&base_.u[at], lines_.base_u[run], lines_.base_du[run]);
        ok &= fit(&base_.v[at], lines_.base_v[run], lines_.base_dv[run]);
        ok &= fit(&step_.u[at], lines_.step_u[run], lines_.step_du[run]);
        ok &= fit(&step_.v[at], lines_.step_v[run], lines_.step_dv[run]);
        if (!ok) lines_.base_u[run] = std::numeric_limits<float>::quiet_NaN();
    }
}

void GroupMotion::positions(int y, float fraction, float* x_out, float* y_out) const {
    const size_t from = size_t(y) * size_t(width());
    for (int x = 0; x < width(); ++x) {
        x_out[x] = float(x) + (base_.u[from + size_t(x)] + fraction * step_.u[from + size_t(x)]);
        y_out[x] = float(y) + (base_.v[from + size_t(x)] + fraction * step_.v[from + size_t(x)]);
    }
}

double GroupMotion::linear_share() const {
    const size_t count = size_t(runs()) * size_t(height());
    size_t linear = 0;
    for (size_t run = 0; run < count; ++run) linear += !std::isnan(lines_.base_u[run]);
    return count ? double(linear) / double(count) : 0;
}

void warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                 int16_t* out, size_t out_pitch) {
    assert(source.counts && source.largest <= 16383);
    assert(motion.width() == source.width && motion.height() == source.height);
    assert(range.first >= 0 && range.count >= 0 && range.first + range.count <= source.height);
    HWY_DYNAMIC_DISPATCH(warp_range)(source, motion, fraction, range, out, out_pitch);
}

void warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, int16_t* out, size_t out_pitch) {
    warp_counts(source, motion, fraction, {0, source.height}, out, out_pitch);
}

}  // namespace ols
#endif
