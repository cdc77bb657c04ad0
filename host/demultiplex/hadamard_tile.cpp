// SPDX-License-Identifier: MIT
// A tile goes through four passes over one cache's worth of places: pairs of rows to sums and differences, with the
// squares that the certificate needs; codelets; squares of the outputs and their conversion, straight past the caches.
//
// The certificate: H H' = n I, so that the sum of all z^2 of a sample is n times the sum of its y^2 (Parseval). A z that
// wrapped modulo 2^16 has a smaller square than the true one, so that the sum over a tile is n times that of the rows only
// if none did; -32768, which 32768 wraps to, counts as wrapped. Both sides are computed exactly (SquareSum). Sums on
// the way to z may wrap, which changes nothing modulo 2^16.
//
// z(0), the sum of all rows, mostly wraps. It is known modulo 2^16 from the wrapped sum, and from the sum of y >> 8 to
// +-20400, which together give it exactly.
#include "demultiplex/hadamard_tile.hpp"

// No processor made since 2008 has SSSE3 and not SSE4.1, and each path takes seconds to compile.
#define HWY_DISABLED_TARGETS HWY_SSSE3

#include <algorithm>
#include <cassert>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "demultiplex/hadamard_tile.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "demultiplex/tile_sink_inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// What codelets add up: the compiler's own vectors, of which it keeps more in registers than of Highway's structures.
// Unsigned, for sums on the way may wrap, and only those of unsigned numbers may do so in C++.
typedef uint16_t ShortLanes __attribute__((vector_size(hn::MaxLanes(Shorts()) * sizeof(uint16_t)), may_alias));

HWY_INLINE ShortLanes& at(int16_t* places, size_t place) {
    return *reinterpret_cast<ShortLanes*>(places + place * tile_samples);
}
HWY_INLINE const ShortLanes& at(const int16_t* places, size_t place) {
    return *reinterpret_cast<const ShortLanes*>(places + place * tile_samples);
}

#include "hadamard_codelets.inc"

void run_codelet(Codelet codelet, const int16_t* from, int16_t* to) {
    switch (codelet) {
        case Codelet::paley_80: return paley_80(from, to);
        case Codelet::williamson_even: return williamson_even(from, to);
        case Codelet::williamson_odd: return williamson_odd(from, to);
        case Codelet::williamson_merge: return williamson_merge(from, to);
    }
}

// Plays all sums over the places, in 32 bits.
void play(const SumCode& plan, int32_t* HWY_RESTRICT places) {
    const Longs d;
    const auto at = [places](uint16_t place) { return places + size_t(place) * tile_samples; };
    const uint16_t* const end = plan.code.data() + plan.code.size();
    for (const uint16_t* op = plan.code.data(); op < end;) {
        const uint16_t* const plus = op + 3;
        const uint16_t* const minus = plus + op[1];
        const uint16_t* const next = minus + op[2];
        for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
            auto sum = hn::Load(d, at(*plus) + i);
            for (const uint16_t* term = plus + 1; term < minus; ++term) sum = hn::Add(sum, hn::Load(d, at(*term) + i));
            for (const uint16_t* term = minus; term < next; ++term) sum = hn::Sub(sum, hn::Load(d, at(*term) + i));
            hn::Store(sum, d, at(op[0]) + i);
        }
        op = next;
    }
}

// The rows of a tile: sample i of row r is rows[r][offset + i].
struct TileRows {
    const int16_t* const* rows;
    size_t offset, ahead;  // ahead: from here to the samples to fetch into the cache for a tile to come
};

// What the first pass finds out about the rows.
struct RowSums {
    int64_t squares = 0;
    bool has_lowest = false;
    alignas(64) int32_t sums[tile_samples];
};

// First pass: pairs of rows to their places. z(0) goes to sums.sums.
void split_rows(const HadamardPlan& plan, const TileRows& tile, int16_t* HWY_RESTRICT places, RowSums& sums) {
    const Shorts d;
    const Longs d32;
    constexpr int unit_log2 = 8;
    // A shift leaves 0 to 255 of each row behind.
    const auto middle = hn::Set(d32, int32_t(plan.rows) * ((1 << unit_log2) - 1) / 2);
    SquareSum squares;
    auto least = hn::Zero(d);
    alignas(64) int16_t wrapped_sums[tile_samples], coarse_sums[tile_samples];
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
        auto wrapped = hn::Zero(d), coarse = hn::Zero(d);
        const auto* const rows = tile.rows;
        const size_t offset = tile.offset + i, ahead = tile.ahead;
        for (const HadamardPlan::Pair& pair : plan.pairs) {
            const int16_t* const first = rows[pair.first] + offset;
            const int16_t* const second = rows[pair.second] + offset;
            hwy::Prefetch(first + ahead);
            hwy::Prefetch(second + ahead);
            const auto a = hn::LoadU(d, first), b = hn::LoadU(d, second), sum = hn::Add(a, b);
            hn::Store(sum, d, places + size_t(pair.sum) * tile_samples + i);
            hn::Store(hn::Sub(a, b), d, places + size_t(pair.difference) * tile_samples + i);
            squares.add(a, b);
            least = hn::Min(least, hn::Min(a, b));
            wrapped = hn::Add(wrapped, sum);
            coarse = hn::Add(coarse, hn::Add(hn::ShiftRight<unit_log2>(a), hn::ShiftRight<unit_log2>(b)));
        }
        for (const HadamardPlan::Single& single : plan.singles) {
            const auto a = hn::LoadU(d, rows[single.row] + offset);
            hn::Store(a, d, places + size_t(single.place) * tile_samples + i);
            hn::Store(hn::Neg(a), d, places + size_t(single.negated) * tile_samples + i);
            squares.add(a, hn::Zero(d));
            least = hn::Min(least, a);
            wrapped = hn::Add(wrapped, a);
            coarse = hn::Add(coarse, hn::ShiftRight<unit_log2>(a));
        }
        hn::Store(wrapped, d, wrapped_sums + i);
        hn::Store(coarse, d, coarse_sums + i);
    }
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d32)) {
        const auto near = hn::Add(hn::ShiftLeft<unit_log2>(load_long(coarse_sums + i)), middle);
        const auto distance = hn::Sub(load_long(wrapped_sums + i), near);
        hn::Store(hn::Add(near, hn::ShiftRight<16>(hn::ShiftLeft<16>(distance))), d32, sums.sums + i);
    }
    sums.squares = squares.total();
    sums.has_lowest = !hn::AllFalse(d, hn::Eq(least, hn::Set(d, INT16_MIN)));
}

// Third pass: true when no output wrapped.
bool certify(const HadamardPlan& plan, const int16_t* HWY_RESTRICT places, const RowSums& sums) {
    const Shorts d;
    SquareSum squares;
    auto least = hn::Zero(d);
    const auto z = [&](size_t k) { return places + size_t(plan.outputs[k - 1]) * tile_samples; };
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
        size_t k = 1;
        for (; k + 1 < size_t(plan.order); k += 2) {
            const auto a = hn::Load(d, z(k) + i), b = hn::Load(d, z(k + 1) + i);
            squares.add(a, b);
            least = hn::Min(least, hn::Min(a, b));
        }
        const auto last = hn::Load(d, z(size_t(plan.order - 1)) + i);  // the order is even
        squares.add(last, hn::Zero(d));
        least = hn::Min(least, last);
    }
    int64_t square_of_sums = 0;
    for (const int32_t sum : sums.sums) square_of_sums += int64_t(sum) * sum;
    return hn::AllFalse(d, hn::Eq(least, hn::Set(d, INT16_MIN))) &&
           squares.total() == plan.order * sums.squares - square_of_sums;
}

uint64_t count_clipped(const int32_t* z, size_t count) {
    return uint64_t(std::count_if(z, z + count, [](int32_t v) { return v != std::clamp(v, INT16_MIN, INT16_MAX); }));
}

// All lamps of a tile, from outputs in either width: those of z(k) at z(k). Returns how many were clipped.
template <typename Lane, typename Value, typename Z>
uint64_t store_lamps(const HadamardPlan& plan, const Sink<Value>& sink, const Z& z, const Lane* extra_row,
                     const int32_t* sums) {
    uint64_t clipped = 0;
    const auto put = [&](size_t lamp, const auto* values) HWY_ATTR {
        sink.put(lamp, values);
        if constexpr (std::is_same_v<Value, int16_t> && std::is_same_v<decltype(values), const int32_t*>)
            clipped += count_clipped(values, sink.count);
    };
    for (size_t lamp = 0; lamp < plan.lamp_output.size(); ++lamp) {
        const int output = plan.lamp_output[lamp];
        if (output > 0) {
            put(lamp, z(size_t(output)));
        } else {
            alignas(64) int32_t wide[tile_samples];
            for (size_t i = 0; i < tile_samples; ++i) wide[i] = sums[i] + plan.extra_weight * extra_row[i];
            put(lamp, static_cast<const int32_t*>(wide));
        }
    }
    return clipped;
}

template <typename Lane, typename Z>
uint64_t store_lamps(const HadamardJob& job, size_t begin, size_t count, const Z& z, const Lane* extra_row,
                     const int32_t* sums) {
    alignas(64) float factors[tile_samples];
    if (!job.factors.empty()) std::copy_n(job.factors.data() + begin, count, factors);
    uint64_t clipped = 0;
    const auto store = [&]<typename Value>(const Planes<Value>& planes) HWY_ATTR {
        if (planes.empty()) return;
        const Sink<Value> sink{planes, planes.offset(begin), count, factors, job.offsets, begin};
        clipped += store_lamps(*job.plan, sink, z, extra_row, sums);
    };
    store(job.sums), store(job.shorts), store(job.floats), store(job.halves);
    return clipped;
}

// Copies the tile of a row, of 32 bits at `from`, to one of 16. False when a count does not fit.
bool narrow_row(const int32_t* from, size_t count, int16_t* HWY_RESTRICT to) {
    const hn::Rebind<int16_t, Longs> narrow;
    const Longs d;
    alignas(64) int32_t tail[tile_samples] = {};
    if (count < tile_samples) from = std::copy_n(from, count, tail) - count;
    auto wrong = hn::Zero(d);
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
        const auto counts = hn::LoadU(d, from + i);
        const auto demoted = hn::DemoteTo(narrow, counts);  // saturates
        wrong = hn::Or(wrong, hn::Xor(counts, hn::PromoteTo(d, demoted)));
        hn::Store(demoted, narrow, to + i);
    }
    return hn::AllTrue(d, hn::Eq(wrong, hn::Zero(d)));
}

// What is fetched into caches before it is needed. The nearest one gets the tile after the next. Plain images are also
// fetched into the second, half a kilobyte (of 16 bits) an image at a time: a line of each in turn would have the memory open a
// page for every line, and where images are a multiple of 4 KB apart, as most are, the lines of all rows would contend
// for one set of the nearest cache for longer than it can hold them. Tiles lie one behind the other, as the processor expects.
constexpr size_t tiles_ahead = 2, tiles_fetched = 8;

// Inline, for the compiler leaves out calls of a function that changes nothing.
template <typename Sample>
HWY_INLINE void fetch_ahead(const Planes<const Sample>& rows, size_t begin) {
    constexpr size_t run = tiles_fetched * tile_samples, line = 64 / sizeof(Sample);
    if (rows.tile_step != tile_samples || begin % run != 0) return;
    for (const Sample* row : rows.first)
        for (size_t at = run; at < 2 * run; at += line)
            __builtin_prefetch(row + begin + at, 0, 2);  // past the end of a row it does nothing
}

class TileInverter {
  public:
    TileInverter(const HadamardJob& job, TileScratch& scratch, TileCounts& counts)
        : job_(job), plan_(*job.plan), scratch_(scratch), counts_(counts) {
        for (int r = 0; r < plan_.rows; ++r) copies_.push_back(scratch.copied_rows() + size_t(r) * tile_samples);
        const auto is_null = [](const auto* row) { return row == nullptr; };
        has_lost_row_ = std::any_of(job.rows16.first.begin(), job.rows16.first.end(), is_null) ||
                        std::any_of(job.rows32.first.begin(), job.rows32.first.end(), is_null);
        assert(!has_lost_row_ || job.filler);
    }

    void invert(size_t begin, size_t count) {
        counts_.tiles++;
        if (!has_lost_row_ && invert_as_they_are(begin, count)) return;
        if (job_.rows32.empty() ? load_long(job_.rows16, begin, count) : load_long(job_.rows32, begin, count)) {
            counts_.filled++;
            job_.filler->fill(scratch_.long_places(), begin, count);
            if (narrow([&](int r) { return scratch_.long_places() + size_t(r) * tile_samples; }, count) &&
                invert_short({copies_.data(), 0, 0}, begin, count))
                return;
        }
        counts_.fallbacks++;
        invert_long(begin, count);
    }

  private:
    // False when a sample is masked, or a count or a sum does not fit 16 bits.
    bool invert_as_they_are(size_t begin, size_t count) {
        if (!job_.rows32.empty()) {
            fetch_ahead(job_.rows32, begin);
            const size_t offset = job_.rows32.offset(begin);
            return narrow([&](int r) { return job_.rows32.first[size_t(r)] + offset; }, count) &&
                   invert_short({copies_.data(), 0, 0}, begin, count);
        }
        const size_t offset = job_.rows16.offset(begin);
        fetch_ahead(job_.rows16, begin);
        if (count == tile_samples)
            return invert_short({job_.rows16.first.data(), offset, tiles_ahead * job_.rows16.tile_step}, begin, count);
        for (int r = 0; r < plan_.rows; ++r) {
            int16_t* const to = scratch_.copied_rows() + size_t(r) * tile_samples;
            std::fill(std::copy_n(job_.rows16.first[size_t(r)] + offset, count, to), to + tile_samples, int16_t(0));
        }
        return invert_short({copies_.data(), 0, 0}, begin, count);
    }

    template <typename Row>
    bool narrow(const Row& row, size_t count) {
        bool fits = true;
        for (int r = 0; r < plan_.rows; ++r)
            fits = narrow_row(row(r), count, scratch_.copied_rows() + size_t(r) * tile_samples) && fits;
        return fits;
    }

    bool invert_short(const TileRows& tile, size_t begin, size_t count) {
        int16_t* const places = scratch_.short_places();
        RowSums sums;
        split_rows(plan_, tile, places, sums);
        if (sums.has_lowest) return false;
        for (const HadamardPlan::Step& step : plan_.steps)
            run_codelet(step.codelet, places + size_t(step.from) * tile_samples,
                        places + size_t(step.to) * tile_samples);
        if (!certify(plan_, places, sums)) return false;
        const auto z = [&](size_t k) -> const int16_t* { return places + size_t(plan_.outputs[k - 1]) * tile_samples; };
        counts_.clipped += store_lamps(job_, begin, count, z, tile.rows[plan_.extra_row] + tile.offset, sums.sums);
        return true;
    }

    // Copies a tile's rows, of either width, to places of 32 bits. True when one of them is masked.
    template <typename Sample>
    bool load_long(const Planes<const Sample>& rows, size_t begin, size_t count) {
        const Longs d;
        // Without a filler nothing is masked, and this is what the lowest value becomes: itself.
        const auto lowest = hn::Set(d, masked_sample<Sample>);
        const auto lost = hn::Set(d, job_.filler ? masked_sample<int32_t> : int32_t(masked_sample<Sample>));
        bool masked = false;
        for (int r = 0; r < plan_.rows; ++r) {
            int32_t* const to = scratch_.long_places() + size_t(r) * tile_samples;
            const Sample* from = rows.first[size_t(r)];
            alignas(64) Sample padded[tile_samples] = {};
            if (!from)
                std::fill_n(padded, count, masked_sample<Sample>);
            else
                std::copy_n(from + rows.offset(begin), count, padded);
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
                const auto counts = HWY_NAMESPACE::load_long(padded + i);
                const auto is_lost = hn::Eq(counts, lowest);
                masked = masked || (job_.filler && !hn::AllFalse(d, is_lost));
                hn::Store(hn::IfThenElse(is_lost, lost, counts), d, to + i);
            }
        }
        return masked;
    }

    void invert_long(size_t begin, size_t count) {
        int32_t* const places = scratch_.long_places();
        alignas(64) int32_t sums[tile_samples] = {};
        for (int r = 0; r < plan_.rows; ++r)
            for (size_t i = 0; i < tile_samples; ++i) sums[i] += places[size_t(r) * tile_samples + i];
        play(plan_.code, places);
        const auto z = [&](size_t k) -> const int32_t* {
            return places + size_t(plan_.code.outputs[k - 1]) * tile_samples;
        };
        counts_.clipped += store_lamps(job_, begin, count, z, places + size_t(plan_.extra_row) * tile_samples, sums);
    }

    const HadamardJob& job_;
    const HadamardPlan& plan_;
    TileScratch& scratch_;
    TileCounts& counts_;
    std::vector<const int16_t*> copies_;
    bool has_lost_row_;
};

void invert(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts) {
    TileInverter inverter(job, scratch, counts);
    for (; begin < end; begin += tile_samples) inverter.invert(begin, std::min(tile_samples, end - begin));
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(invert);

TileScratch::TileScratch(const HadamardPlan& plan)
    : short_places_(size_t(plan.places)), copied_rows_(size_t(plan.rows)), long_places_(size_t(plan.code.places)) {}

void invert_tiles(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts) {
    assert(begin % tile_samples == 0);
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
