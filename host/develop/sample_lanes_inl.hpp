// SPDX-License-Identifier: MIT
// Sample lanes: samples of any kind as vectors of floats, and back.

// Included once for each SIMD path.
#if defined(OLS_SAMPLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef OLS_SAMPLE_LANES_INL
#undef OLS_SAMPLE_LANES_INL
#else
#define OLS_SAMPLE_LANES_INL
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <type_traits>

#include "demultiplex/masked_sample.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats =
    hn::CappedTag<float, 16>;  // divides a cache line of any kind of sample: rows of a band are padded to lines
using Longs = hn::RebindToSigned<Floats>;
using FloatVector = hn::Vec<Floats>;
using FloatMask = hn::Mask<Floats>;

struct Samples {
    FloatVector value;
    FloatMask is_seen;
};

template <typename Sum>
HWY_INLINE Samples load(const Sum* at) {
    const Floats d;
    if constexpr (std::is_same_v<Sum, float>) {
        const FloatVector value = hn::LoadU(d, at);
        return {value, hn::Eq(value, value)};
    } else {
        const Longs di;
        auto counts = hn::Zero(di);
        if constexpr (sizeof(Sum) == 2)
            counts = hn::PromoteTo(di, hn::LoadU(hn::Rebind<int16_t, Floats>(), at));
        else
            counts = hn::LoadU(di, at);
        return {hn::ConvertTo(d, counts), hn::RebindMask(d, hn::Ne(counts, hn::Set(di, masked_sample<Sum>)))};
    }
}

// Integers are rounded, half away from zero, and held to what the inversion takes: 16383 of shorts (fits_shorts()), 2^23 - 1 of
// others (SampleFiller).
template <typename Sum>
HWY_INLINE void store(FloatMask changes, FloatVector value, Sum* at) {
    const Floats d;
    if constexpr (std::is_same_v<Sum, float>) {
        hn::StoreU(hn::IfThenElse(changes, value, hn::LoadU(d, at)), d, at);
    } else {
        const Longs di;
        constexpr float most = sizeof(Sum) == 2 ? 16383.0f : 8388607.0f;
        const auto held = hn::Min(hn::Max(value, hn::Set(d, -most)), hn::Set(d, most));
        const auto counts = hn::ConvertTo(di, hn::Add(held, hn::CopySign(hn::Set(d, 0.5f), held)));
        const auto is_changed = hn::RebindMask(di, changes);
        if constexpr (sizeof(Sum) == 2) {
            const hn::Rebind<int16_t, Floats> d16;
            const auto before = hn::PromoteTo(di, hn::LoadU(d16, at));
            hn::StoreU(hn::DemoteTo(d16, hn::IfThenElse(is_changed, counts, before)), d16, at);
        } else {
            hn::StoreU(hn::IfThenElse(is_changed, counts, hn::LoadU(di, at)), di, at);
        }
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#endif
