// SPDX-License-Identifier: MIT
// From 32-bit or 16-bit sums of a tile to images of every type, past the caches.

// Included once for each SIMD path.
#if defined(OLS_TILE_SINK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OLS_TILE_SINK_INL
#undef OLS_TILE_SINK_INL
#else
#define OLS_TILE_SINK_INL
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include <algorithm>

#include "demultiplex/tile_lanes_inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using LongVector = decltype(hn::Zero(Longs()));
using Floats = hn::Rebind<float, Longs>;

#if HWY_TARGET == HWY_NEON || (HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2)
template <class V>
HWY_INLINE auto half_of(V value) {
    return hn::BitCast(hn::Rebind<uint16_t, Longs>(), hn::DemoteTo(hn::Rebind<hwy::float16_t, Longs>(), value));
}
#else
// Without an instruction for it: the rounding of a float addition, or of integers, does the rounding to even (F. Giesen,
// "Float->half variants", 2012).
template <class V>
HWY_INLINE auto half_of(V value) {
    const Floats df;
    const hn::RebindToUnsigned<Floats> du;
    const hn::RebindToSigned<Floats> di;
    const auto bits = hn::BitCast(di, value), magnitude = hn::And(bits, hn::Set(di, 0x7fffffff));
    const auto sign = hn::BitCast(di, hn::ShiftRight<16>(hn::BitCast(du, hn::Xor(bits, magnitude))));
    const auto subnormal_magic = hn::Set(di, (127 - 15 + 23 - 10 + 1) << 23);
    const auto shifted = hn::Add(hn::BitCast(df, magnitude), hn::BitCast(df, subnormal_magic));
    const auto subnormal = hn::Sub(hn::BitCast(di, shifted), subnormal_magic);
    const auto odd = hn::And(hn::ShiftRight<13>(magnitude), hn::Set(di, 1));
    const auto rounded = hn::Add(hn::Add(magnitude, hn::Set(di, 0xfff - ((127 - 15) << 23))), odd);
    auto half =
        hn::IfThenElse(hn::Lt(magnitude, hn::Set(di, (127 - 14) << 23)), subnormal, hn::ShiftRight<13>(rounded));
    const auto infinite = hn::Set(di, 255 << 23);
    half = hn::IfThenElse(hn::Lt(magnitude, hn::Set(di, (127 + 16) << 23)), half, hn::Set(di, 0x7c00));
    half = hn::IfThenElse(hn::Gt(magnitude, infinite), hn::Set(di, 0x7e00), half);
    return hn::DemoteTo(hn::Rebind<uint16_t, Longs>(), hn::Or(half, sign));
}
#endif

// What becomes of the samples of a tile on their way to floats; offsets may be null.
struct Calibration {
    const float *factors, *offsets;  // the factors aligned

    HWY_INLINE Calibration from(size_t i) const { return {factors + i, offsets ? offsets + i : nullptr}; }
};

// One vector of z as each type of output.
HWY_INLINE auto converted(LongVector z, const Calibration&, int32_t) {
    return z;
}
HWY_INLINE auto converted(LongVector z, const Calibration&, int16_t) {
    return hn::DemoteTo(hn::Rebind<int16_t, Longs>(), z);  // saturates
}
HWY_INLINE auto converted(LongVector z, const Calibration& of, float) {
    const Floats d;
    const auto value = hn::Mul(hn::ConvertTo(d, z), hn::Load(d, of.factors));
    return of.offsets ? hn::Sub(value, hn::LoadU(d, of.offsets)) : value;
}
HWY_INLINE auto converted(LongVector z, const Calibration& of, uint16_t) {
    return half_of(converted(z, of, float()));
}

// Stream for vectors of 16 bytes or more, which alone there are instructions for.
template <class V, class D, typename Value>
HWY_INLINE void write_past(V v, D d, Value* to) {
    if constexpr (hn::MaxLanes(D()) * sizeof(Value) >= 16)
        hn::Stream(v, d, to);
    else
        hn::Store(v, d, to);
}

// Where a tile's values go: whole aligned tiles past the caches, as they are not read again soon.
template <typename Value>
struct Sink {
    Planes<Value> planes;
    size_t offset, count;
    const float* factors;  // aligned
    std::span<const float* const> offsets;
    size_t begin;  // the tile's first sample in `offsets`

    template <typename Lane>
    HWY_INLINE void put(size_t lamp, const Lane* z) const {
        Value* const to = planes.first[lamp] + offset;
        const float* less = offsets.empty() ? nullptr : offsets[lamp] + begin;
        if (count == tile_samples && reinterpret_cast<uintptr_t>(to) % 64 == 0) return stream(z, {factors, less}, to);
        alignas(64) Value values[tile_samples];
        alignas(64) float padded[tile_samples];
        if (less && count < tile_samples) less = std::copy_n(less, count, padded) - count;
        const Calibration of{factors, less};
        for (size_t i = 0; i < tile_samples; i += hn::Lanes(Longs()))
            hn::Store(converted(load_long(z + i), of.from(i), Value()), hn::Rebind<Value, Longs>(), values + i);
        std::copy_n(values, count, to);
    }

  private:
    template <typename Lane>
    HWY_INLINE void stream(const Lane* z, const Calibration& of, Value* to) const {
        if constexpr (std::is_same_v<Value, Lane>) {
            const hn::CappedTag<Value, tile_samples> d;
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) hn::Stream(hn::Load(d, z + i), d, to + i);
        } else {
            for (size_t i = 0; i < tile_samples; i += hn::Lanes(Longs()))
                write_past(converted(load_long(z + i), of.from(i), Value()), hn::Rebind<Value, Longs>(), to + i);
        }
    }
};

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#endif
