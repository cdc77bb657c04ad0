// SPDX-License-Identifier: MIT
// Runs of eight target pixels. Most lie on a line of motion along which neither row nor column slips by more than one pixel:
// their counts are what lies under them, shifted as a whole, or one pixel further; nothing is gathered, and two runs fill a
// vector. Else their sources mostly lie within sixteen pixels of two or three rows, which fit registers, so that the gather is
// a byte shuffle. Where motion is wilder than that, a pixel at a time, by the same arithmetic.
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

#endif  // HWY_TARGET != HWY_SCALAR

// Eight positions as whole pixels and weights: base + fraction * step of each, or of the line. False where all are outside.
HWY_INLINE bool find_sources(const CountPlane& source, const GroupMotion& motion, int run, int y, float fraction,
                             Sources& s) {
    const hn::CappedTag<float, at_once> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const bool holds = source.holds_edges;
    const auto part = [&](auto coordinate, int size, int16_t* whole, int16_t* weight) HWY_ATTR {
        const auto held = hn::Min(hn::Max(coordinate, hn::Zero(df)), hn::Set(df, float(size - 1)));
        const auto at_pixel = hn::ConvertTo(di, held);
        const auto rest = hn::Sub(held, hn::ConvertTo(df, at_pixel));
        hn::StoreU(hn::DemoteTo(d16, at_pixel), d16, whole);
        const auto units = hn::NearestInt(hn::Mul(rest, hn::Set(df, float(1 << one_log2))));
        hn::StoreU(hn::DemoteTo(d16, units), d16, weight);              // saturates
        return hn::Not(hn::Eq(holds ? coordinate : held, coordinate));  // NaN is outside, too
    };
    const GroupMotion::Lines& lines = motion.lines();
    const size_t at = size_t(y) * size_t(motion.runs()) + size_t(run);
    const GroupMotion::OwnVectors* const own = motion.own_vectors(run, y);
    const auto share = hn::Set(df, fraction);
    bool is_inside = false;
    for (int k = 0; k < at_once; k += int(hn::Lanes(df))) {
        const auto vector = [&](int component, const auto& base, const auto& base_change, const auto& step,
                                const auto& step_change) HWY_ATTR {
            const auto sum = [&](auto a, auto b) HWY_ATTR { return hn::Add(a, hn::Mul(share, b)); };
            if (own) return sum(hn::LoadU(df, own->of[component] + k), hn::LoadU(df, own->of[component + 2] + k));
            return hn::Add(
                sum(hn::Set(df, base[at]), hn::Set(df, step[at])),
                hn::Mul(hn::Iota(df, float(k)), sum(hn::Set(df, base_change[at]), hn::Set(df, step_change[at]))));
        };
        const auto u = vector(0, lines.base_u, lines.base_du, lines.step_u, lines.step_du);
        const auto v = vector(1, lines.base_v, lines.base_dv, lines.step_v, lines.step_dv);
        const auto pixel_x = hn::Iota(df, float(motion.first_of(run) + k)), pixel_y = hn::Set(df, float(y));
        const auto out_x = part(hn::Add(pixel_x, u), source.width, s.x + k, s.fx + k);
        const auto out_y = part(hn::Add(pixel_y, v), source.height, s.y + k, s.fy + k);
        const auto outside = hn::Or(out_x, out_y);
        is_inside = is_inside || !hn::AllTrue(df, outside);
        hn::StoreU(hn::DemoteTo(d16, hn::VecFromMask(di, hn::RebindMask(di, outside))), d16, s.outside + k);
    }
    return is_inside;
}

void warp_pixels(const CountPlane& source, const Sources& s, int precision, int16_t* out) {
    for (int k = 0; k < std::min(at_once, source.width); ++k) out[k] = pixel(source, s, k, precision);
}

// A run by its own positions.
template <int precision>
void warp_run(const CountPlane& source, const GroupMotion& motion, int run, int y, float fraction, int16_t* out) {
    Sources s;
    if (!find_sources(source, motion, run, y, fraction, s)) {
        std::fill_n(out, std::min(at_once, source.width), masked);
        return;
    }
#if HWY_TARGET != HWY_SCALAR
    if (source.width >= table_pixels) {
        const D16 d;
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
                source,
                {base_x, base_y, column, next, row, hn::Load(d, s.fx), hn::Load(d, s.fy), hn::Load(d, s.outside)}, out);
    }
#endif
    warp_pixels(source, s, precision, out);
}

// Runs of one row on lines, in units of 2^-13 pixels.
constexpr int line_log2 = 13;
constexpr int line_one = 1 << line_log2;
struct LineRow {
    std::vector<int16_t> start;   // four a run: x, its change from pixel to pixel, y, its change; less `offset`
    std::vector<int32_t> offset;  // of the count before which no pixel of the run slips, from the plane's begin
    std::vector<int16_t> rows;    // that all pixels of the run lie above: 1 or 2; 0 where the run does not fit
    bool is_still;                // all of the row

    explicit LineRow(int runs) : start(4 * size_t(runs) + 64), offset(size_t(runs) + 16), rows(size_t(runs) + 16) {}
};

// A line fits when along it the whole part of neither coordinate's vector changes by more than one, and when all counts that
// are read for it, three columns of eight and two or three rows, are the plane's.
void find_lines(const CountPlane& source, const GroupMotion& motion, float fraction, int y, LineRow& row) {
    const hn::CappedTag<float, 16> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const int runs = motion.runs();
    const GroupMotion::Lines& lines = motion.lines();
    const auto share = hn::Set(df, fraction), unit = hn::Set(df, float(line_one));
    const auto last = hn::Set(di, at_once - 1), zero = hn::Zero(di);
    auto moved = zero;
    for (int r = 0; r < runs; r += int(hn::Lanes(df))) {
        const size_t from = size_t(y) * size_t(runs) + size_t(r);
        const auto vector = [&](const std::vector<float>& base, const std::vector<float>& step) HWY_ATTR {
            return hn::Add(hn::LoadU(df, &base[from]), hn::Mul(share, hn::LoadU(df, &step[from])));
        };
        const auto u = vector(lines.base_u, lines.step_u), v = vector(lines.base_v, lines.step_v);
        const auto du = vector(lines.base_du, lines.step_du), dv = vector(lines.base_dv, lines.step_dv);
        const auto x = hn::NearestInt(hn::Mul(u, unit)), dx = hn::NearestInt(hn::Mul(du, unit));
        const auto at_y = hn::NearestInt(hn::Mul(v, unit)), dy = hn::NearestInt(hn::Mul(dv, unit));
        const auto end_x = hn::Add(x, hn::Mul(dx, last)), end_y = hn::Add(at_y, hn::Mul(dy, last));
        const auto slip_x = hn::ShiftRight<line_log2>(hn::Min(x, end_x));
        const auto slip_y = hn::ShiftRight<line_log2>(hn::Min(at_y, end_y));
        const auto most_x = hn::ShiftRight<line_log2>(hn::Max(x, end_x));
        const auto most_y = hn::ShiftRight<line_log2>(hn::Max(at_y, end_y));

        const auto run = hn::Iota(di, r);
        const auto first_x = hn::Min(hn::ShiftLeft<3>(run), hn::Set(di, source.width - at_once));
        const auto base_x = hn::Add(first_x, slip_x), base_y = hn::Add(hn::Set(di, y), slip_y);
        const auto below = hn::Sub(most_y, slip_y);
        // Where it is no line the vectors are NaN, which is below nothing; huge ones would overflow.
        const auto limit = hn::Set(df, 30000.0f), steepest = hn::Set(df, 1.0f);
        const auto is_line = hn::And(hn::And(hn::Lt(hn::Abs(u), limit), hn::Lt(hn::Abs(v), limit)),
                                     hn::And(hn::Lt(hn::Abs(du), steepest), hn::Lt(hn::Abs(dv), steepest)));
        auto fits = hn::VecFromMask(di, hn::RebindMask(di, is_line));
        const auto not_line = hn::Not(fits);
        const auto forbid = [&](auto condition) HWY_ATTR { fits = hn::AndNot(hn::VecFromMask(di, condition), fits); };
        const auto one = hn::Set(di, 1);
        forbid(hn::Gt(hn::Sub(most_x, slip_x), one));
        forbid(hn::Gt(below, one));
        forbid(hn::Lt(base_x, zero));
        forbid(hn::Gt(base_x, hn::Set(di, source.width - at_once - 2)));
        forbid(hn::Lt(base_y, zero));
        forbid(hn::Gt(hn::Add(base_y, below), hn::Set(di, source.height - 2)));
        const auto movement = hn::Or(not_line, hn::Or(hn::Or(x, dx), hn::Or(at_y, dy)));
        moved = hn::Or(moved, hn::And(movement, hn::VecFromMask(di, hn::Lt(run, hn::Set(di, runs)))));

        const auto within = [&](auto value, auto slip)
                                HWY_ATTR { return hn::DemoteTo(d16, hn::Sub(value, hn::ShiftLeft<line_log2>(slip))); };
        hn::StoreInterleaved4(within(x, slip_x), hn::DemoteTo(d16, dx), within(at_y, slip_y), hn::DemoteTo(d16, dy),
                              d16, &row.start[4 * size_t(r)]);
        hn::StoreU(hn::Add(hn::Mul(base_y, hn::Set(di, int32_t(source.pitch))), base_x), di, &row.offset[size_t(r)]);
        hn::StoreU(hn::DemoteTo(d16, hn::And(fits, hn::Add(below, one))), d16, &row.rows[size_t(r)]);
    }
    row.is_still = hn::AllTrue(di, hn::Eq(moved, zero));
}

#if HWY_TARGET == HWY_SCALAR

constexpr int runs_at_once = 1;

template <int precision>
void warp_lines(const CountPlane& source, const LineRow& row, size_t r, size_t, int16_t* out) {
    Sources s;
    const int16_t* const start = &row.start[4 * r];
    const int base_x = row.offset[r] % int(source.pitch), base_y = row.offset[r] / int(source.pitch);
    for (int k = 0; k < at_once; ++k) {
        const int x = start[0] + k * start[1], y = start[2] + k * start[3];
        s.x[k] = int16_t(base_x + k + (x >> line_log2));
        s.y[k] = int16_t(base_y + (y >> line_log2));
        s.fx[k] = int16_t((x % line_one) << (one_log2 - line_log2));
        s.fy[k] = int16_t((y % line_one) << (one_log2 - line_log2));
        s.outside[k] = 0;
    }
    warp_pixels(source, s, precision, out);
}

#else

// A run a block of 128 bits, two where vectors have two.
using Runs = hn::CappedTag<int16_t, 2 * at_once>;
constexpr int runs_at_once = int(hn::MaxLanes(Runs())) / at_once;
using RunVector = hn::Vec<Runs>;
using RunMask = hn::Mask<Runs>;

struct RunPointers {
    const int16_t *first, *second;
};

HWY_INLINE RunVector load_runs(RunPointers at, int column) {
    const Runs d;
    if constexpr (runs_at_once == 1) {
        return hn::LoadU(d, at.first + column);
    } else {
        const hn::Half<Runs> half;
        return hn::Combine(d, hn::LoadU(half, at.second + column), hn::LoadU(half, at.first + column));
    }
}

// Counts of one source row: under a pixel, and right of it.
struct SlippedTaps {
    RunVector left, right;
};

HWY_INLINE SlippedTaps slipped_taps(RunPointers at, RunMask slips) {
    const RunVector first = load_runs(at, 0), second = load_runs(at, 1), third = load_runs(at, 2);
    return {hn::IfThenElse(slips, second, first), hn::IfThenElse(slips, third, second)};
}

template <int precision>
HWY_INLINE RunVector across(SlippedTaps row, RunVector weight) {
    const RunVector left = hn::ShiftLeft<precision>(row.left), right = hn::ShiftLeft<precision>(row.right);
    return hn::Add(left, hn::MulFixedPoint15(hn::Sub(right, left), weight));
}

// A neighbour without weight may be masked.
HWY_INLINE RunVector without_masked(RunVector value, SlippedTaps top, SlippedTaps bottom, RunVector fx, RunVector fy) {
    const Runs d;
    const RunMask whole_x = hn::Eq(fx, hn::Zero(d)), whole_y = hn::Eq(fy, hn::Zero(d));
    const auto least_of = [&](SlippedTaps row)
                              HWY_ATTR { return hn::Min(row.left, hn::IfThenElse(whole_x, row.left, row.right)); };
    const RunVector upper = least_of(top), lower = hn::IfThenElse(whole_y, upper, least_of(bottom));
    const RunVector none = hn::Set(d, masked);
    return hn::IfThenElse(hn::Eq(hn::Min(upper, lower), none), none, value);
}

// Runs r and, in the second block, r + 1 by the counts at `second_run`: r + 1, or r where r + 1 does not fit, which leaves in
// that block what is of no use. r and second_run fit.
template <int precision>
HWY_INLINE void warp_lines(const CountPlane& source, const LineRow& row, size_t r, size_t second_run, int16_t* out) {
    const Runs d;
    const hn::Repartition<uint8_t, Runs> d8;
    // The same of a run's four numbers in all lanes of its block.
    const auto start = hn::LoadDup128(d, &row.start[4 * r]);
    const RunVector block = hn::IfThenElse(hn::FirstN(d, at_once), hn::Zero(d), hn::Set(d, 0x0808));
    const auto number = [&](int16_t which) HWY_ATTR {
        const RunVector bytes = hn::Add(block, hn::Set(d, int16_t(which * 0x0202 + 0x0100)));
        return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, start), hn::BitCast(d8, bytes)));
    };
    const RunVector steps = hn::And(hn::Iota(d, 0), hn::Set(d, at_once - 1));
    const RunVector x = hn::Add(number(0), hn::Mul(steps, number(1))),
                    y = hn::Add(number(2), hn::Mul(steps, number(3)));
    const RunVector before_slip = hn::Set(d, line_one - 1), weights = hn::Set(d, (1 << one_log2) - 1);
    const RunVector fx = hn::And(hn::ShiftLeft<one_log2 - line_log2>(x), weights);
    const RunVector fy = hn::And(hn::ShiftLeft<one_log2 - line_log2>(y), weights);
    const RunMask slips_x = hn::Gt(x, before_slip), slips_y = hn::Gt(y, before_slip);

    const int16_t* const first = source.counts + row.offset[r];
    const int16_t* const second = source.counts + row.offset[second_run];
    const size_t pitch = source.pitch;
    SlippedTaps top = slipped_taps({first, second}, slips_x);
    SlippedTaps bottom = slipped_taps({first + pitch, second + pitch}, slips_x);
    if (!hn::AllFalse(d, slips_y)) {
        const size_t first_rows = size_t(row.rows[r]), second_rows = size_t(row.rows[second_run]);
        const SlippedTaps third = slipped_taps({first + first_rows * pitch, second + second_rows * pitch}, slips_x);
        top = {hn::IfThenElse(slips_y, bottom.left, top.left), hn::IfThenElse(slips_y, bottom.right, top.right)};
        bottom = {hn::IfThenElse(slips_y, third.left, bottom.left), hn::IfThenElse(slips_y, third.right, bottom.right)};
    }
    const RunVector upper = across<precision>(top, fx), lower = across<precision>(bottom, fx);
    RunVector value = hn::Add(upper, hn::MulFixedPoint15(hn::Sub(lower, upper), fy));
    if constexpr (precision > 0) value = hn::ShiftRight<precision>(hn::Add(value, hn::Set(d, 1 << precision >> 1)));
    const RunVector least = hn::Min(hn::Min(top.left, top.right), hn::Min(bottom.left, bottom.right));
    if (!hn::AllFalse(d, hn::Eq(least, hn::Set(d, masked)))) value = without_masked(value, top, bottom, fx, fy);
    hn::StoreU(value, d, out);
}

#endif

template <int precision>
void warp_rows(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range, int16_t* out,
               size_t out_pitch) {
    LineRow row(motion.runs());
    const int whole_runs = source.width / at_once;  // the last one of other widths overlaps that before
    for (int y = range.first; y < range.first + range.count; ++y) {
        int16_t* const to = out + size_t(y - range.first) * out_pitch;
        find_lines(source, motion, fraction, y, row);
        if (row.is_still) {
            std::copy_n(source.counts + size_t(y) * source.pitch, source.width, to);
            continue;
        }
        for (int r = 0; r < motion.runs(); ++r) {
            const size_t run = size_t(r);
            if (!row.rows[run]) {
                warp_run<precision>(source, motion, r, y, fraction, to + motion.first_of(r));
            } else if (runs_at_once == 2 && r + 1 < whole_runs && row.rows[run + 1]) {
                warp_lines<precision>(source, row, run, run + 1, to + r * at_once);
                ++r;
            } else {
                int16_t counts[runs_at_once * at_once];
                warp_lines<precision>(source, row, run, run, counts);
                std::copy_n(counts, at_once, to + motion.first_of(r));
            }
        }
    }
}

void warp_range(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                int16_t* out, size_t out_pitch) {
    constexpr int fine_largest = 4095, fine_bits = 2;
    if (source.largest <= fine_largest)
        warp_rows<fine_bits>(source, motion, fraction, range, out, out_pitch);
    else
        warp_rows<0>(source, motion, fraction, range, out, out_pitch);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(warp_range);

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
