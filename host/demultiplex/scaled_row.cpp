// SPDX-License-Identifier: MIT
// One pass, as fast as memory takes it.
#include "demultiplex/scaled_row.hpp"

#include <cstdint>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "demultiplex/scaled_row.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#include "demultiplex/tile_sink_inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE auto values_of(const float* row) {
    return hn::LoadU(Floats(), row);
}
HWY_INLINE auto values_of(const int32_t* row) {
    return hn::ConvertTo(Floats(), hn::LoadU(Longs(), row));
}
HWY_INLINE auto values_of(const int16_t* row) {
    return hn::ConvertTo(Floats(), hn::PromoteTo(Longs(), hn::LoadU(hn::Rebind<int16_t, Longs>(), row)));
}

// Float holds the weight and the samples, so that their product is rounded once, as from double.
template <typename Sample>
void scale(const Sample* row, size_t samples, const RowScale& by, float* out) {
    const Floats d;
    const auto weight = hn::Set(d, float(by.weight));
    const bool is_aligned = reinterpret_cast<uintptr_t>(out) % 64 == 0;
    size_t p = 0;
    for (; p + hn::Lanes(d) <= samples; p += hn::Lanes(d)) {
        auto value = hn::Mul(hn::Mul(weight, values_of(row + p)), hn::LoadU(d, by.factors + p));
        if (by.offsets) value = hn::Sub(value, hn::LoadU(d, by.offsets + p));
        if (is_aligned)
            write_past(value, d, out + p);
        else
            hn::StoreU(value, d, out + p);
    }
    for (; p < samples; ++p) {
        const float value = float(by.weight) * float(row[p]) * by.factors[p];
        out[p] = by.offsets ? value - by.offsets[p] : value;
    }
}

void scale_shorts(const int16_t* row, size_t samples, const RowScale& by, float* out) {
    scale(row, samples, by, out);
}
void scale_longs(const int32_t* row, size_t samples, const RowScale& by, float* out) {
    scale(row, samples, by, out);
}
void scale_floats(const float* row, size_t samples, const RowScale& by, float* out) {
    scale(row, samples, by, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(scale_shorts);
HWY_EXPORT(scale_longs);
HWY_EXPORT(scale_floats);

namespace {

void scale_fast(const int16_t* row, size_t samples, const RowScale& scale, float* out) {
    HWY_DYNAMIC_DISPATCH(scale_shorts)(row, samples, scale, out);
}
void scale_fast(const int32_t* row, size_t samples, const RowScale& scale, float* out) {
    HWY_DYNAMIC_DISPATCH(scale_longs)(row, samples, scale, out);
}
void scale_fast(const float* row, size_t samples, const RowScale& scale, float* out) {
    HWY_DYNAMIC_DISPATCH(scale_floats)(row, samples, scale, out);
}

}  // namespace

template <typename Sample>
void scale_row(const Sample* row, size_t samples, const RowScale& scale, float* out) {
    if (double(float(scale.weight)) == scale.weight) return scale_fast(row, samples, scale, out);
    for (size_t p = 0; p < samples; ++p) {
        const float value = float(scale.weight * double(row[p])) * scale.factors[p];
        out[p] = scale.offsets ? value - scale.offsets[p] : value;
    }
}

template void scale_row(const int16_t*, size_t, const RowScale&, float*);
template void scale_row(const int32_t*, size_t, const RowScale&, float*);
template void scale_row(const float*, size_t, const RowScale&, float*);

}  // namespace ols
#endif
