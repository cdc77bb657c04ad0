// SPDX-License-Identifier: MIT
// Vectors of a tile of samples, and the exact sum of their squares.

// Included once for each SIMD path.
#if defined(OLS_TILE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OLS_TILE_LANES_INL
#undef OLS_TILE_LANES_INL
#else
#define OLS_TILE_LANES_INL
#endif

#include <hwy/highway.h>

#include "demultiplex/planes.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Shorts = hn::CappedTag<int16_t, tile_samples>;
using Longs = hn::CappedTag<int32_t, tile_samples / 2>;  // as many bytes

HWY_INLINE auto load_long(const int32_t* z) {
    return hn::Load(Longs(), z);
}
HWY_INLINE auto load_long(const int16_t* z) {
    return hn::PromoteTo(Longs(), hn::Load(hn::Rebind<int16_t, Longs>(), z));
}

// The sum of the squares of int16 vectors, none of which has -32768, exact while they are fewer than 2^16 pairs: lanes
// add up the squares of two pairs, below 2^32, modulo 2^32, and the upper halves of these.
class SquareSum {
    using Vector = decltype(hn::Zero(Longs()));
    using ShortVector = decltype(hn::Zero(Shorts()));
    static constexpr bool has_second = HWY_ARCH_ARM;  // x86 adds the squares of neighbours up, others have two vectors

  public:
    HWY_INLINE SquareSum() : whole_(hn::Zero(d)), upper_(hn::Zero(d)) {}

    HWY_INLINE void add(ShortVector a, ShortVector b) {
        Vector second = hn::Zero(d), first = hn::ReorderWidenMulAccumulate(d, a, a, hn::Zero(d), second);
        first = hn::ReorderWidenMulAccumulate(d, b, b, first, second);
        add_lanes(first);
        if (has_second) add_lanes(second);
    }

    int64_t total() const {
        alignas(64) uint32_t whole[hn::MaxLanes(Longs())], upper[hn::MaxLanes(Longs())];
        hn::Store(hn::BitCast(du, whole_), du, whole);
        hn::Store(hn::BitCast(du, upper_), du, upper);
        int64_t total = 0;
        for (size_t i = 0; i < hn::Lanes(d); ++i)
            total += (int64_t(upper[i]) << 16) + uint32_t(whole[i] - (upper[i] << 16));
        return total;
    }

  private:
    HWY_INLINE void add_lanes(Vector squares) {
        whole_ = hn::Add(whole_, squares);
        upper_ = hn::Add(upper_, hn::BitCast(d, hn::ShiftRight<16>(hn::BitCast(du, squares))));
    }

    static constexpr Longs d{};
    static constexpr hn::RebindToUnsigned<Longs> du{};
    Vector whole_, upper_;
};

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#endif
