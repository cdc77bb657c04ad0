// SPDX-License-Identifier: MIT
// Unpacking: whole words and bytes by plain loops, 10 and 12 packed bits by one shuffle of bytes for eight samples, everything else
// and the ends of rows sample by sample.
//
// Method of the shuffle: each sample of 10 or 12 bits lies in two bytes, in all five packings. These are brought into a word each;
// what of the sample begins elsewhere is moved up to where it belongs by a multiplication, as the places differ from lane to lane,
// and one shift brings all down: ((word & top) | (word & moved) * by) >> (16 - bits).
#include "image/sample_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/sample_layout.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#ifndef OLS_SAMPLE_SHUFFLE
#define OLS_SAMPLE_SHUFFLE
namespace ols {

constexpr size_t lanes = 8;

struct SampleShuffle {
    alignas(16) uint8_t bytes[2 * lanes];
    alignas(16) uint16_t top[lanes], moved[lanes], by[lanes];
    size_t step_bytes;  // of eight samples
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
template <int bits>
size_t shuffle_row(const uint8_t*, size_t, const SampleShuffle&, size_t, uint16_t*) {
    return 0;
}
#else
// As many eights as there are 16 bytes for. Returns how many samples that were.
template <int bits>
HWY_INLINE size_t shuffle_row(const uint8_t* from, size_t from_bytes, const SampleShuffle& by, size_t samples,
                              uint16_t* to) {
    const hn::FixedTag<uint8_t, 2 * lanes> d8;
    const hn::FixedTag<uint16_t, lanes> d16;
    const auto bytes = hn::Load(d8, by.bytes);
    const auto top = hn::Load(d16, by.top), moved = hn::Load(d16, by.moved), factor = hn::Load(d16, by.by);
    size_t n = 0;
    for (size_t at = 0; n + lanes <= samples && at + 2 * lanes <= from_bytes; n += lanes, at += by.step_bytes) {
        const auto words = hn::BitCast(d16, hn::TableLookupBytes(hn::LoadU(d8, from + at), bytes));
        const auto up = hn::Or(hn::And(words, top), hn::Mul(hn::And(words, moved), factor));
        hn::StoreU(hn::ShiftRight<16 - bits>(up), d16, to + n);
    }
    return n;
}
#endif

size_t shuffle_row_10(const uint8_t* from, size_t from_bytes, const SampleShuffle& by, size_t samples, uint16_t* to) {
    return shuffle_row<10>(from, from_bytes, by, samples, to);
}
size_t shuffle_row_12(const uint8_t* from, size_t from_bytes, const SampleShuffle& by, size_t samples, uint16_t* to) {
    return shuffle_row<12>(from, from_bytes, by, samples, to);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(shuffle_row_10);
HWY_EXPORT(shuffle_row_12);

namespace {

static_assert(std::endian::native == std::endian::little);

// How groups of samples share bytes: `samples` of them take `bytes`. MIPI: four of 10 bits, two of 12.
struct Group {
    size_t samples, bytes;
};
Group mipi_group(int bits) {
    return bits == 10 ? Group{4, 5} : Group{2, 3};
}

// Where a sample of 8 high bits and some low ones has them: a byte each, and in that of the low ones from which bit on.
struct SplitPlace {
    size_t high, low;
    int low_bit;
};
SplitPlace split_place(const SampleLayout& layout, size_t n) {
    if (layout.packing == SamplePacking::gige_pairs) return {n / 2 * 3 + (n % 2) * 2, n / 2 * 3 + 1, n % 2 ? 4 : 0};
    const Group group = mipi_group(layout.bits);
    const size_t first = n / group.samples * group.bytes, place = n % group.samples;
    return {first + place, first + group.samples, int(place) * (layout.bits - 8)};
}

bool is_split(SamplePacking packing) {
    return packing == SamplePacking::gige_pairs || packing == SamplePacking::mipi;
}
bool is_stream(SamplePacking packing) {
    return packing == SamplePacking::bits_low || packing == SamplePacking::bits_high;
}
bool is_shuffled(const SampleLayout& layout) {
    return (is_split(layout.packing) || is_stream(layout.packing)) && (layout.bits == 10 || layout.bits == 12);
}

uint16_t split_sample(const uint8_t* row, const SampleLayout& layout, size_t n) {
    const SplitPlace place = split_place(layout, n);
    const int low_bits = layout.bits - 8;
    return uint16_t(row[place.high] << low_bits | (row[place.low] >> place.low_bit & ((1 << low_bits) - 1)));
}

// A sample begins in one byte and ends in the same, the next or the one after.
uint16_t stream_sample(const uint8_t* row, const SampleLayout& layout, size_t n) {
    const size_t first_bit = n * size_t(layout.bits), first = first_bit / 8, begin = first_bit % 8;
    const size_t count = (begin + size_t(layout.bits) + 7) / 8;
    const bool is_low = layout.packing == SamplePacking::bits_low;
    uint32_t gathered = 0;
    for (size_t k = 0; k < count; ++k) gathered |= uint32_t(row[first + k]) << 8 * (is_low ? k : count - 1 - k);
    const size_t below = is_low ? begin : 8 * count - begin - size_t(layout.bits);
    return uint16_t(gathered >> below & ((1u << layout.bits) - 1));
}

SampleShuffle shuffle_of(const SampleLayout& layout) {
    SampleShuffle shuffle{};
    const bool is_high = layout.packing == SamplePacking::bits_high;
    for (size_t n = 0; n < lanes; ++n) {
        if (is_split(layout.packing)) {
            const SplitPlace place = split_place(layout, n);
            shuffle.bytes[2 * n] = uint8_t(place.low);
            shuffle.bytes[2 * n + 1] = uint8_t(place.high);
            shuffle.top[n] = 0xff00;
            shuffle.moved[n] = uint16_t(((1 << (layout.bits - 8)) - 1) << place.low_bit);
            shuffle.by[n] = uint16_t(1 << (16 - layout.bits - place.low_bit));
        } else {
            const size_t first = n * size_t(layout.bits) / 8, begin = n * size_t(layout.bits) % 8;
            shuffle.bytes[2 * n] = uint8_t(first + is_high);
            shuffle.bytes[2 * n + 1] = uint8_t(first + !is_high);
            shuffle.moved[n] = 0xffff;
            shuffle.by[n] = uint16_t(1 << (is_high ? begin : size_t(16 - layout.bits) - begin));
        }
    }
    shuffle.step_bytes = packed_row_bytes(layout, lanes);
    return shuffle;
}

template <typename Change>
void change_words(const uint8_t* from, size_t samples, uint16_t* to, Change change) {
    for (size_t n = 0; n < samples; ++n) {
        uint16_t word;
        std::memcpy(&word, from + n * sizeof word, sizeof word);
        to[n] = uint16_t(change(word));
    }
}

void unpack_words(const uint8_t* from, const SampleLayout& layout, size_t samples, uint16_t* to) {
    const int below = 16 - layout.bits;
    switch (layout.packing) {
        case SamplePacking::words_high:
            return change_words(from, samples, to, [below](int word) { return word >> below; });
        case SamplePacking::words_big:
            return change_words(from, samples, to, [](int word) { return word << 8 | word >> 8; });
        default: std::memcpy(to, from, samples * sizeof(uint16_t));
    }
}

// `from_bytes` are those that may be read, also beyond this row.
void unpack_row(const uint8_t* from, size_t from_bytes, const SampleLayout& layout, const SampleShuffle& shuffle,
                size_t samples, uint16_t* to) {
    if (layout.packing == SamplePacking::bytes) {
        std::copy_n(from, samples, to);
        return;
    }
    if (!is_split(layout.packing) && !is_stream(layout.packing)) return unpack_words(from, layout, samples, to);
    size_t n = 0;
    if (is_shuffled(layout))
        n = layout.bits == 10 ? HWY_DYNAMIC_DISPATCH(shuffle_row_10)(from, from_bytes, shuffle, samples, to)
                              : HWY_DYNAMIC_DISPATCH(shuffle_row_12)(from, from_bytes, shuffle, samples, to);
    const auto sample = is_split(layout.packing) ? split_sample : stream_sample;
    for (; n < samples; ++n) to[n] = sample(from, layout, n);
}

Status check_layout(const SampleLayout& layout) {
    bool is_known = layout.bits >= 8 && layout.bits <= 16 && layout.packing <= SamplePacking::mipi;
    if (layout.packing == SamplePacking::bytes) is_known = layout.bits == 8;
    if (is_split(layout.packing)) is_known = layout.bits == 10 || layout.bits == 12;
    if (is_known) return Done{};
    return fail(
        fmt::format("samples of {} bits in packing {} are none that this program unpacks: choose another "
                    "pixel format",
                    layout.bits, int(layout.packing)));
}

}  // namespace

size_t packed_row_bytes(const SampleLayout& layout, size_t samples) {
    switch (layout.packing) {
        case SamplePacking::bytes: return samples;
        case SamplePacking::gige_pairs: return samples / 2 * 3 + samples % 2 * 2;
        case SamplePacking::mipi: {
            const Group group = mipi_group(layout.bits);
            return (samples + group.samples - 1) / group.samples * group.bytes;
        }
        case SamplePacking::bits_low:
        case SamplePacking::bits_high: return (samples * size_t(layout.bits) + 7) / 8;
        default: return samples * sizeof(uint16_t);
    }
}

Status unpack_samples(std::span<const std::byte> from, const SampleLayout& layout, size_t samples, size_t height,
                      size_t row_bytes, std::span<uint16_t> to) {
    if (const Status known = check_layout(layout); !known.ok()) return known;
    if (samples == 0 || height == 0 ? !to.empty() : to.size() % samples != 0 || to.size() / samples != height)
        return fail(fmt::format("{} rows of {} samples do not go into room for {}", height, samples, to.size()));
    if (to.empty()) return Done{};
    if (row_bytes == 0) samples *= height, height = 1;
    const size_t least = packed_row_bytes(layout, samples);
    if (height > 1 && row_bytes < least)
        return fail(fmt::format("rows of {} samples of {} bits take {} bytes, and they are {} bytes apart", samples,
                                layout.bits, least, row_bytes));
    if (from.size() < least || (from.size() - least) / std::max<size_t>(row_bytes, 1) < height - 1)
        return fail(fmt::format("a picture of {} rows of {} samples of {} bits is cut short: {} bytes came", height,
                                samples, layout.bits, from.size()));
    const SampleShuffle shuffle = is_shuffled(layout) ? shuffle_of(layout) : SampleShuffle{};
    const auto* const bytes = reinterpret_cast<const uint8_t*>(from.data());
    for (size_t y = 0; y < height; ++y)
        unpack_row(bytes + y * row_bytes, from.size() - y * row_bytes, layout, shuffle, samples,
                   to.data() + y * samples);
    return Done{};
}

}  // namespace ols
#endif
