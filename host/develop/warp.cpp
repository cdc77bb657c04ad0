// SPDX-License-Identifier: MIT
// Runs of sixteen target samples. Most lie on a line of motion along which neither row nor column slips by more than one step of
// the grid: their counts are what lies under them, shifted as a whole, or one step further; nothing is gathered, and the colours
// of a mosaic need not be taken apart. Else their sources mostly lie within sixteen columns of two or three rows, which fit
// registers, so that the gather is a byte shuffle. Where motion is wilder than that, a sample at a time, by the same
// arithmetic.
#include "develop/warp.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "demultiplex/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "develop/warp.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int run_samples = GroupMotion::run_samples;
constexpr int at_once = 8;         // target samples with vectors of their own
constexpr int table_columns = 16;  // of a source row, in two registers
constexpr int one_log2 = 15;       // weights are in units of 2^-15
constexpr int16_t masked = masked_sample<int16_t>;

// Sources of eight samples: column and row of the upper left one, and weights.
struct Sources {
    alignas(16) int16_t x[at_once], y[at_once], fx[at_once], fy[at_once];
    alignas(16) int16_t outside[at_once];  // -1 or 0
};

// `precision` extra bits while interpolating; |a - b| << precision must fit int16.
HWY_INLINE int16_t lerp(int16_t a, int16_t b, int16_t weight) {
    return int16_t(a + ((int32_t(b - a) * weight + (1 << (one_log2 - 1))) >> one_log2));
}

HWY_INLINE int16_t sample(const CountPlane& source, const Sources& s, int k, int precision) {
    if (s.outside[k]) return masked;
    const int step = source.grid.step, x = s.x[k], y = s.y[k];
    const int right = s.fx[k] && x + step < source.grid.width ? x + step : x;
    const int below = s.fy[k] && y + step < source.grid.height ? y + step : y;
    const int16_t* top = source.counts + size_t(y) * source.pitch;
    const int16_t* bottom = source.counts + size_t(below) * source.pitch;
    const int16_t c[4] = {top[x], top[right], bottom[x], bottom[right]};
    if (std::min({c[0], c[1], c[2], c[3]}) == masked) return masked;
    const auto fine = [&](int16_t v) { return int16_t(v * (1 << precision)); };
    const int16_t upper = lerp(fine(c[0]), fine(c[1]), s.fx[k]), lower = lerp(fine(c[2]), fine(c[3]), s.fx[k]);
    return int16_t((lerp(upper, lower, s.fy[k]) + (1 << precision >> 1)) >> precision);
}

#if HWY_TARGET != HWY_SCALAR

using D16 = hn::FixedTag<int16_t, at_once>;
using V16 = hn::Vec<D16>;
using M16 = hn::Mask<D16>;

// The counts of one source row that eight samples need: at x and a step further.
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

// Where eight samples whose sources fit the table have them: columns from `base_x` with the next ones, rows from `base_y` (0 or
// 1 step), weights, and -1 where they are outside.
struct Shuffled {
    int base_x, base_y;
    V16 x, next_x, y, fx, fy, outside;
};

// Whether any is masked.
template <int precision>
HWY_INLINE bool eight(const CountPlane& source, const Shuffled& s, int16_t* out) {
    const D16 d;
    const V16 fx = s.fx, fy = s.fy;
    const M16 whole_x = hn::Eq(fx, hn::Zero(d)), whole_y = hn::Eq(fy, hn::Zero(d));
    const V16 next = hn::IfThenElse(whole_x, s.x, s.next_x);
    // Lane 2 x in the lower byte, 2 x + 1 in the upper.
    const auto bytes_of = [&](V16 lane)
                              HWY_ATTR { return hn::Add(hn::Mul(lane, hn::Set(d, 0x0202)), hn::Set(d, 0x0100)); };
    const V16 left = bytes_of(s.x), right = bytes_of(next);
    const int step = source.grid.step;
    const auto row_taps = [&](int steps) HWY_ATTR {
        // Rows beyond the last one have no weight.
        const int row = s.base_y + steps * step < source.grid.height ? s.base_y + steps * step : s.base_y;
        return taps(source.counts + size_t(row) * source.pitch + size_t(s.base_x), left, right);
    };
    RowTaps top = row_taps(0), bottom = row_taps(1);
    const M16 lower_rows = hn::Ne(s.y, hn::Zero(d));
    if (!hn::AllFalse(d, lower_rows)) {
        const RowTaps third = row_taps(2);
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
    const M16 is_gone = hn::MaskFromVec(gone);
    hn::StoreU(hn::IfThenElse(is_gone, none, sum), d, out);
    return !hn::AllFalse(d, is_gone);
}

#endif  // HWY_TARGET != HWY_SCALAR

// Where eight samples of a run, from its sample `first` on, are found: base + fraction * step of each, or of the line. False
// where all are outside.
template <int step>
HWY_INLINE bool find_sources(const CountPlane& source, const GroupMotion& motion, int run, int first, int y,
                             float fraction, Sources& s) {
    static_assert(step == 1 || step == 2);
    constexpr int step_log2 = step - 1;
    const hn::CappedTag<float, at_once> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const bool holds = source.holds_edges;
    // From a coordinate in steps of its colour, of which there are `last` + 1 at `color`, to a sample and a weight.
    const auto part = [&](auto coordinate, auto last, auto color, int16_t* whole, int16_t* weight) HWY_ATTR {
        const auto held = hn::Min(hn::Max(coordinate, hn::Zero(df)), hn::ConvertTo(df, last));
        const auto at_step = hn::ConvertTo(di, held);
        const auto rest = hn::Sub(held, hn::ConvertTo(df, at_step));
        hn::StoreU(hn::DemoteTo(d16, hn::Add(hn::ShiftLeft<step_log2>(at_step), color)), d16, whole);
        const auto units = hn::NearestInt(hn::Mul(rest, hn::Set(df, float(1 << one_log2))));
        hn::StoreU(hn::DemoteTo(d16, units), d16, weight);              // saturates
        return hn::Not(hn::Eq(holds ? coordinate : held, coordinate));  // NaN is outside, too
    };
    const auto color_of = [&](auto at) HWY_ATTR { return hn::And(at, hn::Set(di, step - 1)); };
    const auto last_of = [&](int size, auto color)
                             HWY_ATTR { return hn::ShiftRight<step_log2>(hn::Sub(hn::Set(di, size - 1), color)); };
    const auto steps_of = [&](auto at) HWY_ATTR { return hn::ConvertTo(df, hn::ShiftRight<step_log2>(at)); };

    const GroupMotion::Lines& lines = motion.lines();
    const size_t at = size_t(y) * size_t(motion.runs()) + size_t(run);
    const GroupMotion::OwnVectors* const own = motion.own_vectors(run, y);
    const auto share = hn::Set(df, fraction);
    bool is_inside = false;
    for (int k = 0; k < at_once; k += int(hn::Lanes(df))) {
        const auto vector = [&](int component, const auto& base, const auto& base_change, const auto& change,
                                const auto& change_change) HWY_ATTR {
            const auto sum = [&](auto a, auto b) HWY_ATTR { return hn::Add(a, hn::Mul(share, b)); };
            if (own)
                return sum(hn::LoadU(df, own->of[component] + first + k),
                           hn::LoadU(df, own->of[component + 2] + first + k));
            return hn::Add(sum(hn::Set(df, base[at]), hn::Set(df, change[at])),
                           hn::Mul(hn::Iota(df, float(first + k)),
                                   sum(hn::Set(df, base_change[at]), hn::Set(df, change_change[at]))));
        };
        const auto u = vector(0, lines.base_u, lines.base_du, lines.step_u, lines.step_du);
        const auto v = vector(1, lines.base_v, lines.base_dv, lines.step_v, lines.step_dv);
        const auto column = hn::Iota(di, motion.first_of(run) + first + k), row = hn::Set(di, y);
        const auto color_x = color_of(column), color_y = color_of(row);
        const auto out_x =
            part(hn::Add(steps_of(column), u), last_of(source.grid.width, color_x), color_x, s.x + k, s.fx + k);
        const auto out_y =
            part(hn::Add(steps_of(row), v), last_of(source.grid.height, color_y), color_y, s.y + k, s.fy + k);
        const auto outside = hn::Or(out_x, out_y);
        is_inside = is_inside || !hn::AllTrue(df, outside);
        hn::StoreU(hn::DemoteTo(d16, hn::VecFromMask(di, hn::RebindMask(di, outside))), d16, s.outside + k);
    }
    return is_inside;
}

// Eight samples of a run, `count` of which there are, by their own positions. Whether any is masked.
template <int precision, int step>
bool warp_eight(const CountPlane& source, const GroupMotion& motion, int run, int first, int y, float fraction,
                int count, int16_t* out) {
    Sources s;
    if (!find_sources<step>(source, motion, run, first, y, fraction, s)) {
        std::fill_n(out, count, masked);
        return true;
    }
#if HWY_TARGET != HWY_SCALAR
    if (source.grid.width >= table_columns && count == at_once) {
        const D16 d;
        const int least_x = *std::min_element(s.x, s.x + at_once), least_y = *std::min_element(s.y, s.y + at_once);
        const int base_x = std::min(least_x, source.grid.width - table_columns), base_y = least_y;
        const V16 column = hn::Sub(hn::Load(d, s.x), hn::Set(d, int16_t(base_x)));
        const V16 row = hn::ShiftRight<step - 1>(hn::Sub(hn::Load(d, s.y), hn::Set(d, int16_t(base_y))));
        // The next sample of a colour's last one has no weight.
        const V16 beyond_next = hn::Set(d, int16_t(source.grid.width - base_x));
        const V16 further = hn::Add(column, hn::Set(d, step));
        const V16 next = hn::IfThenElse(hn::Lt(further, beyond_next), further, column);
        const V16 beyond =
            hn::Or(hn::AndNot(hn::Set(d, table_columns - 1), hn::Or(column, next)), hn::AndNot(hn::Set(d, 1), row));
        if (hn::AllTrue(d, hn::Eq(beyond, hn::Zero(d))))
            return eight<precision>(
                source,
                {base_x, base_y, column, next, row, hn::Load(d, s.fx), hn::Load(d, s.fy), hn::Load(d, s.outside)}, out);
    }
#endif
    for (int k = 0; k < count; ++k) out[k] = sample(source, s, k, precision);
    return std::find(out, out + count, masked) != out + count;
}

template <int precision, int step>
bool warp_run(const CountPlane& source, const GroupMotion& motion, int run, int y, float fraction, int16_t* out) {
    const int count = std::min(run_samples, source.grid.width);
    bool any_masked = false;
    for (int first = 0; first < count; first += at_once)
        any_masked |= warp_eight<precision, step>(source, motion, run, first, y, fraction,
                                                  std::min(at_once, count - first), out + first);
    return any_masked;
}

// Lines in units of 2^-13 steps.
constexpr int line_log2 = 13;
constexpr int line_one = 1 << line_log2;
// Of some runs of a row.
struct RunLines {
    static constexpr int most_runs = 64;
    static_assert(most_runs % 16 == 0, "vectors of up to 16 runs are stored whole");

    // The first vector less `offset`, and the change from sample to sample.
    int16_t x[most_runs], dx[most_runs], y[most_runs], dy[most_runs];
    // Of the count before which no sample of the run slips, from the frame's first one.
    int32_t offset[most_runs];
    // That all samples of the run lie above: 1 or 2; 0 where the run does not fit.
    int16_t rows[most_runs];
    bool is_still;  // all of them
};

// Runs of row y.
struct RunRange {
    int first, count, y;
};

// A line fits when along it the whole part of neither coordinate's vector changes by more than one, and when all counts that
// are read for it, three times sixteen columns and two or three rows, are the frame's or its margin's.
void find_lines(const CountPlane& source, const GroupMotion& motion, float fraction, const RunRange& range,
                RunLines& row) {
    const hn::CappedTag<float, 16> df;
    const hn::RebindToSigned<decltype(df)> di;
    const hn::Rebind<int16_t, decltype(df)> d16;
    const int step = source.grid.step;
    const GroupMotion::Lines& lines = motion.lines();
    const auto share = hn::Set(df, fraction), unit = hn::Set(df, float(line_one));
    const auto last = hn::Set(di, run_samples - 1), zero = hn::Zero(di), steps = hn::Set(di, step);
    auto moved = zero;
    for (int r = 0; r < range.count; r += int(hn::Lanes(df))) {
        const size_t from = size_t(range.y) * size_t(motion.runs()) + size_t(range.first + r);
        const auto vector = [&](const std::vector<float>& base, const std::vector<float>& change) HWY_ATTR {
            return hn::Add(hn::LoadU(df, &base[from]), hn::Mul(share, hn::LoadU(df, &change[from])));
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

        const auto run = hn::Iota(di, range.first + r);
        const auto first_x =
            hn::Min(hn::Mul(run, hn::Set(di, run_samples)), hn::Set(di, source.grid.width - run_samples));
        const auto base_x = hn::Add(first_x, hn::Mul(slip_x, steps));
        const auto base_y = hn::Add(hn::Set(di, range.y), hn::Mul(slip_y, steps));
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
        const auto before_first = hn::Set(di, -source.margin);
        forbid(hn::Lt(base_x, before_first));
        forbid(hn::Gt(base_x, hn::Set(di, source.grid.width + source.margin - run_samples - 2 * step)));
        forbid(hn::Lt(base_y, before_first));
        const auto lowest = hn::Add(base_y, hn::Mul(hn::Add(below, one), steps));
        forbid(hn::Gt(lowest, hn::Set(di, source.grid.height + source.margin - 1)));
        const auto movement = hn::Or(not_line, hn::Or(hn::Or(x, dx), hn::Or(at_y, dy)));
        moved =
            hn::Or(moved, hn::And(movement, hn::VecFromMask(di, hn::Lt(run, hn::Set(di, range.first + range.count)))));

        const auto store = [&](auto values, int16_t* list)
                               HWY_ATTR { hn::StoreU(hn::DemoteTo(d16, values), d16, list + r); };
        store(hn::Sub(x, hn::ShiftLeft<line_log2>(slip_x)), row.x);
        store(dx, row.dx);
        store(hn::Sub(at_y, hn::ShiftLeft<line_log2>(slip_y)), row.y);
        store(dy, row.dy);
        store(hn::And(fits, hn::Add(below, one)), row.rows);
        hn::StoreU(hn::Add(hn::Mul(base_y, hn::Set(di, int32_t(source.pitch))), base_x), di, row.offset + r);
    }
    row.is_still = hn::AllTrue(di, hn::Eq(moved, zero));
}

using Lanes = hn::CappedTag<int16_t, run_samples>;
using LaneVector = hn::Vec<Lanes>;
using LaneMask = hn::Mask<Lanes>;

// Counts of one source row: under a sample, and a step to its right.
struct SlippedTaps {
    LaneVector left, right;
};

// `any_slips`: of `slips`; along most lines none does.
template <int step>
HWY_INLINE SlippedTaps slipped_taps(const int16_t* at, LaneMask slips, bool any_slips) {
    const Lanes d;
    const LaneVector first = hn::LoadU(d, at), second = hn::LoadU(d, at + step);
    if (!any_slips) return {first, second};
    const LaneVector third = hn::LoadU(d, at + 2 * step);
    return {hn::IfThenElse(slips, second, first), hn::IfThenElse(slips, third, second)};
}

template <int precision>
HWY_INLINE LaneVector across(SlippedTaps row, LaneVector weight) {
    const LaneVector left = hn::ShiftLeft<precision>(row.left), right = hn::ShiftLeft<precision>(row.right);
    return hn::Add(left, hn::MulFixedPoint15(hn::Sub(right, left), weight));
}

// A neighbour without weight may be masked.
HWY_INLINE LaneVector without_masked(LaneVector value, SlippedTaps top, SlippedTaps bottom, LaneVector fx,
                                     LaneVector fy) {
    const Lanes d;
    const LaneMask whole_x = hn::Eq(fx, hn::Zero(d)), whole_y = hn::Eq(fy, hn::Zero(d));
    const auto least_of = [&](SlippedTaps row)
                              HWY_ATTR { return hn::Min(row.left, hn::IfThenElse(whole_x, row.left, row.right)); };
    const LaneVector upper = least_of(top), lower = hn::IfThenElse(whole_y, upper, least_of(bottom));
    const LaneVector none = hn::Set(d, masked);
    return hn::IfThenElse(hn::Eq(hn::Min(upper, lower), none), none, value);
}

// A run that fits. Whether any sample of it is masked.
template <int precision, int step>
HWY_INLINE bool warp_line(const CountPlane& source, const RunLines& row, int run, int16_t* out) {
    bool any_masked = false;
    const Lanes d;
    const LaneVector before_slip = hn::Set(d, line_one - 1), weights = hn::Set(d, (1 << one_log2) - 1);
    const LaneVector start_x = hn::Set(d, row.x[run]), dx = hn::Set(d, row.dx[run]);
    const LaneVector start_y = hn::Set(d, row.y[run]), dy = hn::Set(d, row.dy[run]);
    const size_t pitch = source.pitch * step, third_row = size_t(row.rows[run]) * pitch;
    // A cache line has the counts of two runs: one of them asks for the row above, one for that below.
    if (source.next) hwy::Prefetch(source.next + row.offset[run] + (run % 2 ? pitch : 0));
    for (int k = 0; k < run_samples; k += int(hn::Lanes(d))) {
        const LaneVector samples = hn::Iota(d, int16_t(k));
        const LaneVector x = hn::Add(start_x, hn::Mul(samples, dx)), y = hn::Add(start_y, hn::Mul(samples, dy));
        const LaneVector fx = hn::And(hn::ShiftLeft<one_log2 - line_log2>(x), weights);
        const LaneVector fy = hn::And(hn::ShiftLeft<one_log2 - line_log2>(y), weights);
        const LaneMask slips_x = hn::Gt(x, before_slip), slips_y = hn::Gt(y, before_slip);

        const int16_t* const from = source.counts + row.offset[run] + k;
        const bool any_slips = !hn::AllFalse(d, slips_x);
        SlippedTaps top = slipped_taps<step>(from, slips_x, any_slips);
        SlippedTaps bottom = slipped_taps<step>(from + pitch, slips_x, any_slips);
        if (!hn::AllFalse(d, slips_y)) {
            const SlippedTaps third = slipped_taps<step>(from + third_row, slips_x, any_slips);
            top = {hn::IfThenElse(slips_y, bottom.left, top.left), hn::IfThenElse(slips_y, bottom.right, top.right)};
            bottom = {hn::IfThenElse(slips_y, third.left, bottom.left),
                      hn::IfThenElse(slips_y, third.right, bottom.right)};
        }
        const LaneVector upper = across<precision>(top, fx), lower = across<precision>(bottom, fx);
        LaneVector value = hn::Add(upper, hn::MulFixedPoint15(hn::Sub(lower, upper), fy));
        if constexpr (precision > 0) value = hn::ShiftRight<precision>(hn::Add(value, hn::Set(d, 1 << precision >> 1)));
        const LaneVector least = hn::Min(hn::Min(top.left, top.right), hn::Min(bottom.left, bottom.right));
        if (!hn::AllFalse(d, hn::Eq(least, hn::Set(d, masked)))) {
            value = without_masked(value, top, bottom, fx, fy);
            any_masked = true;
        }
        hn::StoreU(value, d, out + k);
    }
    return any_masked;
}

template <int precision, int step>
bool warp_runs(const CountPlane& source, const GroupMotion& motion, float fraction, const RunRange& range,
               int16_t* out) {
    RunLines lines;
    find_lines(source, motion, fraction, range, lines);
    if (lines.is_still) {
        const int first = motion.first_of(range.first),
                  end = motion.first_of(range.first + range.count - 1) + run_samples;
        const int16_t* const from = source.counts + size_t(range.y) * source.pitch;
        const int16_t* const last = from + std::min(end, source.grid.width);
        std::copy(from + first, last, out + first);
        return std::find(from + first, last, masked) != last;
    }
    bool may_be_masked = false;
    for (int r = 0; r < range.count; ++r) {
        const int run = range.first + r;
        if (lines.rows[r]) {
            may_be_masked |= warp_line<precision, step>(source, lines, r, out + motion.first_of(run));
        } else {
            may_be_masked |=
                warp_run<precision, step>(source, motion, run, range.y, fraction, out + motion.first_of(run));
        }
    }
    return may_be_masked;
}

template <int precision, int step>
bool warp_rows(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range, int16_t* out,
               size_t out_pitch) {
    bool may_be_masked = false;
    for (int y = range.first; y < range.first + range.count; ++y)
        for (int run = 0; run < motion.runs(); run += RunLines::most_runs) {
            const RunRange runs{run, std::min(RunLines::most_runs, motion.runs() - run), y};
            may_be_masked |=
                warp_runs<precision, step>(source, motion, fraction, runs, out + size_t(y - range.first) * out_pitch);
        }
    return may_be_masked;
}

bool warp_range(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                int16_t* out, size_t out_pitch) {
    constexpr int fine_largest = 4095, fine_bits = 2;
    const bool is_fine = source.largest <= fine_largest, is_mosaic = source.grid.step == 2;
    const auto warp = is_fine ? (is_mosaic ? warp_rows<fine_bits, 2> : warp_rows<fine_bits, 1>)
                              : (is_mosaic ? warp_rows<0, 2> : warp_rows<0, 1>);
    return warp(source, motion, fraction, range, out, out_pitch);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(warp_range);

bool warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, const RowRange& range,
                 int16_t* out, size_t out_pitch) {
    assert(source.counts && source.largest <= 16383 && motion.grid() == source.grid);
    assert(source.margin == 0 || source.holds_edges);
    assert(range.first >= 0 && range.count >= 0 && range.first + range.count <= source.grid.height);
    return HWY_DYNAMIC_DISPATCH(warp_range)(source, motion, fraction, range, out, out_pitch);
}

bool warp_counts(const CountPlane& source, const GroupMotion& motion, float fraction, int16_t* out, size_t out_pitch) {
    return warp_counts(source, motion, fraction, {0, source.grid.height}, out, out_pitch);
}

}  // namespace ols
#endif
