// SPDX-License-Identifier: MIT
// The certificate: H H' = n I, so that the sum of all z^2 of a sample is n times the sum of its y^2 (Parseval). A sum that
// wrapped modulo 2^16 has a smaller square than the true one, hence the identity fails, in exact arithmetic, for a tile in
// which any did; -32768, which 32768 wraps to, counts as wrapped. The identity is checked modulo 2^32 exactly, and
// to 2^31 by sums of the squares' upper halves: together no multiple of 2^32 can hide.
//
// The sum of all rows mostly wraps. It is known modulo 2^16 from the rows' sum, and from the sum of y >> 8 to +-20400,
// which together give it exactly.
#include "reflectance/hadamard_tile.hpp"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reflectance/hadamard_tile.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Vectors that are summed at once: as many as a tile has, four at most, which the compiler keeps in registers.
template <class D>
constexpr size_t vectors_at_once(D d) {
    return std::min<size_t>(4, tile_samples / hn::MaxLanes(d));
}

// Plays all sums over the places.
template <typename Lane>
void play(const SumCode& plan, Lane* HWY_RESTRICT places) {
    const hn::ScalableTag<Lane> d;
    constexpr size_t lanes = hn::MaxLanes(d), at_once = vectors_at_once(d);
    for (size_t first = 0; first < tile_samples; first += at_once * lanes) {
        Lane* const base = places + first;
        const uint16_t* const end = plan.code.data() + plan.code.size();
        for (const uint16_t* op = plan.code.data(); op < end;) {
            Lane* const to = base + op[0] * tile_samples;
            const uint16_t* const minus = op + 3 + op[1];
            const uint16_t* const next = minus + op[2];
            decltype(hn::Zero(d)) sum[at_once];
            const Lane* from = base + op[3] * tile_samples;
            HWY_UNROLL(4)
            for (size_t v = 0; v < at_once; ++v) sum[v] = hn::Load(d, from + v * lanes);
            for (op += 4; op < minus; ++op) {
                from = base + *op * tile_samples;
                HWY_UNROLL(4)
                for (size_t v = 0; v < at_once; ++v) sum[v] = hn::Add(sum[v], hn::Load(d, from + v * lanes));
            }
            for (; op < next; ++op) {
                from = base + *op * tile_samples;
                HWY_UNROLL(4)
                for (size_t v = 0; v < at_once; ++v) sum[v] = hn::Sub(sum[v], hn::Load(d, from + v * lanes));
            }
            HWY_UNROLL(4)
            for (size_t v = 0; v < at_once; ++v) hn::Store(sum[v], d, to + v * lanes);
        }
    }
}

// Squares of int16 vectors, each pair of lanes added up: x86 gives them in one vector, others in two.
using Pairs = decltype(hn::Zero(hn::ScalableTag<int32_t>()));
constexpr bool pairs_are_two = HWY_ARCH_ARM;

template <class V>
HWY_INLINE Pairs squares(V v, Pairs& second) {
    const hn::ScalableTag<int32_t> d;
    second = hn::Zero(d);
    return hn::ReorderWidenMulAccumulate(d, v, v, hn::Zero(d), second);
}

HWY_INLINE Pairs upper_half(Pairs pairs) {  // unsigned: a pair of -32768 makes 2^31
    const hn::ScalableTag<int32_t> d;
    const hn::ScalableTag<uint32_t> du;
    return hn::BitCast(d, hn::ShiftRight<16>(hn::BitCast(du, pairs)));
}

HWY_INLINE Pairs lower_half(Pairs pairs) {
    const hn::ScalableTag<int32_t> d;
    return hn::And(pairs, hn::Set(d, 0xffff));
}

int64_t total(Pairs sums) {
    const hn::ScalableTag<int32_t> d;
    alignas(64) int32_t lanes[hn::MaxLanes(d)];
    hn::Store(sums, d, lanes);
    int64_t total = 0;
    for (size_t i = 0; i < hn::Lanes(d); ++i) total += uint32_t(lanes[i]);
    return total;
}

// Copies a tile of 16-bit rows to the places. False when one of them is masked.
bool load_rows16(const HadamardJob& job, size_t begin, size_t count, int16_t* HWY_RESTRICT places) {
    const hn::ScalableTag<int16_t> d;
    auto least = hn::Zero(d);
    for (size_t r = 0; r < job.rows16.size(); ++r) {
        int16_t* const to = places + r * tile_samples;
        if (!job.rows16[r]) return false;
        const int16_t* const from = job.rows16[r] + begin;
        if (count == tile_samples) {
            hwy::Prefetch(from + 4 * tile_samples);
            hwy::Prefetch(from + 4 * tile_samples + 32);
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
                const auto counts = hn::LoadU(d, from + i);
                least = hn::Min(least, counts);
                hn::Store(counts, d, to + i);
            }
        } else {
            std::copy_n(from, count, to);
            std::fill(to + count, to + tile_samples, int16_t(0));
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) least = hn::Min(least, hn::Load(d, to + i));
        }
    }
    return !job.filler || hn::AllFalse(d, hn::Eq(least, hn::Set(d, masked_sample<int16_t>)));
}

// The same of `rows` rows of 32 bits, row r at from(r). False when a count does not fit 16 bits, as a masked one does not.
template <typename From>
bool load_rows32(const From& row, size_t rows, size_t count, int16_t* HWY_RESTRICT places) {
    const hn::ScalableTag<int16_t> d;
    const hn::Rebind<int32_t, hn::Half<decltype(d)>> d32;
    const hn::Half<decltype(d)> half;
    auto wrong = hn::Zero(d32);
    for (size_t r = 0; r < rows; ++r) {
        int16_t* const to = places + r * tile_samples;
        const int32_t* from = row(r);
        if (!from) return false;
        alignas(64) int32_t tail[tile_samples] = {};
        if (count < tile_samples) from = std::copy_n(from, count, tail) - count;
        for (size_t i = 0; i < tile_samples; i += hn::Lanes(d32)) {
            const auto counts = hn::LoadU(d32, from + i);
            const auto demoted = hn::DemoteTo(half, counts);  // saturates
            wrong = hn::Or(wrong, hn::Xor(counts, hn::PromoteTo(d32, demoted)));
            hn::StoreU(demoted, half, to + i);
        }
    }
    return hn::AllTrue(d32, hn::Eq(wrong, hn::Zero(d32)));
}

bool load_short(const HadamardJob& job, size_t begin, size_t count, int16_t* HWY_RESTRICT places) {
    if (job.rows32.empty()) return load_rows16(job, begin, count, places);
    const auto row = [&](size_t r) { return job.rows32[r] ? job.rows32[r] + begin : nullptr; };
    return load_rows32(row, job.rows32.size(), count, places);
}

// The sum of all rows, exactly.
void sum_rows(const HadamardPlan& plan, const int16_t* HWY_RESTRICT places, int32_t* HWY_RESTRICT sums) {
    const hn::ScalableTag<int16_t> d;
    const size_t rows = size_t(plan.plan.inputs());
    constexpr int unit_log2 = 8;
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
        auto wrapped = hn::Zero(d), coarse = hn::Zero(d);
        for (size_t r = 0; r < rows; ++r) {
            const auto y = hn::Load(d, places + r * tile_samples + i);
            wrapped = hn::Add(wrapped, y);
            coarse = hn::Add(coarse, hn::ShiftRight<unit_log2>(y));
        }
        alignas(64) int16_t wrapped_lanes[hn::MaxLanes(d)], coarse_lanes[hn::MaxLanes(d)];
        hn::Store(wrapped, d, wrapped_lanes);
        hn::Store(coarse, d, coarse_lanes);
        // A shift leaves 0 to 255 of each row behind.
        const int32_t middle = int32_t(rows) * ((1 << unit_log2) - 1) / 2;
        for (size_t k = 0; k < hn::Lanes(d); ++k) {
            const int32_t near = (int32_t(coarse_lanes[k]) << unit_log2) + middle;
            sums[i + k] = near + int16_t(uint16_t(wrapped_lanes[k]) - uint16_t(near));
        }
    }
}

// The sum of the squares of all rows, exactly.
int64_t row_squares(const HadamardPlan& plan, const int16_t* HWY_RESTRICT places) {
    const hn::ScalableTag<int16_t> d;
    const hn::ScalableTag<int32_t> d32;
    Pairs lower = hn::Zero(d32), upper = hn::Zero(d32), second;
    const size_t end = size_t(plan.plan.inputs()) * tile_samples;
    for (size_t i = 0; i < end; i += hn::Lanes(d)) {
        const Pairs first = squares(hn::Load(d, places + i), second);
        lower = hn::Add(lower, lower_half(first));
        upper = hn::Add(upper, upper_half(first));
        if constexpr (!pairs_are_two) continue;
        lower = hn::Add(lower, lower_half(second));
        upper = hn::Add(upper, upper_half(second));
    }
    return total(lower) + (total(upper) << 16);
}

// True when no output wrapped.
bool certify(const HadamardJob& job, const int16_t* HWY_RESTRICT places, const int32_t* HWY_RESTRICT sums,
             int64_t row_squares) {
    const hn::ScalableTag<int16_t> d;
    const hn::ScalableTag<int32_t> d32;
    Pairs whole = hn::Zero(d32), upper = hn::Zero(d32), second;
    auto least = hn::Zero(d);
    for (const uint16_t place : job.code->outputs)
        for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
            const auto z = hn::Load(d, places + place * tile_samples + i);
            least = hn::Min(least, z);
            const Pairs first = squares(z, second);
            whole = hn::Add(whole, first);
            upper = hn::Add(upper, upper_half(first));
            if constexpr (!pairs_are_two) continue;
            whole = hn::Add(whole, second);
            upper = hn::Add(upper, upper_half(second));
        }
    if (!hn::AllFalse(d, hn::Eq(least, hn::Set(d, INT16_MIN)))) return false;
    int64_t sum_squares = 0;
    for (size_t i = 0; i < tile_samples; ++i) sum_squares += int64_t(sums[i]) * sums[i];
    const int64_t wanted = job.plan->order * row_squares - sum_squares;
    return uint32_t(total(whole)) == uint32_t(wanted) && wanted - (total(upper) << 16) < int64_t(1) << 31;
}

HWY_INLINE void store_lamp(const HadamardJob& job, size_t lamp, size_t at, size_t count, const int32_t* z) {
    const hn::ScalableTag<int32_t> d;
    const hn::ScalableTag<float> df;
    if (!job.sums.empty()) {
        std::copy_n(z, count, job.sums[lamp] + at);
        return;
    }
    float* const to = job.lamps[lamp] + at;
    const float* const factors = job.factors.data() + at;
    const auto times = [&](size_t i) HWY_ATTR {
        return hn::Mul(hn::ConvertTo(df, hn::Load(d, z + i)), hn::LoadU(df, factors + i));
    };
    size_t i = 0;
    if (count == tile_samples && reinterpret_cast<uintptr_t>(to) % 64 == 0)
        for (; i < tile_samples; i += hn::Lanes(d)) hn::Stream(times(i), df, to + i);  // not read again soon
    for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) hn::StoreU(times(i), df, to + i);
    for (; i < count; ++i) to[i] = float(z[i]) * factors[i];
}

// All lamps of a tile, from outputs in either width.
template <typename Lane>
void store_lamps(const HadamardJob& job, size_t begin, size_t count, const Lane* HWY_RESTRICT places,
                 const int32_t* HWY_RESTRICT sums) {
    const hn::ScalableTag<int32_t> d;
    alignas(64) int32_t wide[tile_samples];
    for (size_t lamp = 0; lamp < job.plan->lamp_output.size(); ++lamp) {
        const int output = job.plan->lamp_output[lamp];
        const Lane* const row = places + size_t(job.plan->extra_row) * tile_samples;
        if (output < 0) {
            for (size_t i = 0; i < tile_samples; ++i) wide[i] = sums[i] + job.plan->extra_weight * row[i];
            store_lamp(job, lamp, begin, count, wide);
        } else if constexpr (sizeof(Lane) == sizeof(int32_t)) {
            store_lamp(job, lamp, begin, count, places + job.code->outputs[size_t(output)] * tile_samples);
        } else {
            const hn::Rebind<int16_t, decltype(d)> narrow;
            const int16_t* const z = places + job.code->outputs[size_t(output)] * tile_samples;
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(d))
                hn::Store(hn::PromoteTo(d, hn::Load(narrow, z + i)), d, wide + i);
            store_lamp(job, lamp, begin, count, wide);
        }
    }
}

// Copies a tile's rows, of either width, to places of 32 bits. True when one of them is masked.
template <typename Sample>
bool load_long(const HadamardJob& job, std::span<const Sample* const> rows, size_t begin, size_t count,
               int32_t* places) {
    bool masked = false;
    for (size_t r = 0; r < rows.size(); ++r) {
        int32_t* const to = places + r * tile_samples;
        if (!rows[r]) std::fill_n(to, count, masked_sample<int32_t>), masked = true;
        for (size_t i = 0; rows[r] && i < count; ++i) {
            const Sample counts = rows[r][begin + i];
            const bool lost = job.filler && counts == masked_sample<Sample>;
            to[i] = lost ? masked_sample<int32_t> : counts;
            masked = masked || lost;
        }
        std::fill(to + count, to + tile_samples, 0);
    }
    return masked;
}

// Inverts the rows that lie in the places. False when a sum wrapped.
bool invert_short(const HadamardJob& job, size_t begin, size_t count, int16_t* places) {
    alignas(64) int32_t sums[tile_samples];
    const int64_t squares_in = row_squares(*job.plan, places);
    sum_rows(*job.plan, places, sums);
    play(*job.code, places);
    if (!certify(job, places, sums, squares_in)) return false;
    store_lamps(job, begin, count, places, sums);
    return true;
}

void invert_long(const HadamardJob& job, size_t begin, size_t count, int32_t* places) {
    alignas(64) int32_t sums[tile_samples] = {};
    for (size_t r = 0; r < size_t(job.plan->plan.inputs()); ++r)
        for (size_t i = 0; i < tile_samples; ++i) sums[i] += places[r * tile_samples + i];
    play(*job.code, places);
    store_lamps(job, begin, count, places, sums);
}

void invert(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts) {
    int16_t* const short_places = scratch.short_places();
    int32_t* const long_places = scratch.long_places();
    for (; begin < end; begin += tile_samples) {
        const size_t count = std::min(tile_samples, end - begin);
        counts.tiles++;
        if (load_short(job, begin, count, short_places) && invert_short(job, begin, count, short_places)) continue;
        const bool masked = job.rows32.empty() ? load_long(job, job.rows16, begin, count, long_places)
                                               : load_long(job, job.rows32, begin, count, long_places);
        if (masked) {
            counts.filled++;
            job.filler->fill(long_places, begin, count);
            const auto row = [&](size_t r) { return long_places + r * tile_samples; };
            if (load_rows32(row, size_t(job.plan->plan.inputs()), count, short_places) &&
                invert_short(job, begin, count, short_places))
                continue;
        }
        counts.fallbacks++;
        invert_long(job, begin, count, long_places);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(invert);

TileScratch::TileScratch(const SumCode& code) : places16_(size_t(code.places)), places32_(size_t(code.places)) {}

void invert_tiles(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts) {
    HWY_DYNAMIC_DISPATCH(invert)(job, begin, end, scratch, counts);
}

std::vector<const char*> tile_paths() {
    std::vector<const char*> names;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) names.push_back(hwy::TargetName(target));
    return names;
}

void choose_tile_path(const char* name) {
    hwy::SetSupportedTargetsForTest(0);
    for (const int64_t target : hwy::SupportedAndGeneratedTargets())
        if (name && std::strcmp(name, hwy::TargetName(target)) == 0) hwy::SetSupportedTargetsForTest(target);
}

}  // namespace ols
#endif
