// SPDX-License-Identifier: MIT
// Four sums at a time share the loads of a row. Vectors without a sample that is asked for are passed over.
#include "demultiplex/fill_sums.hpp"

#include "demultiplex/masked_sample.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "demultiplex/fill_sums.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

uint64_t find_masked(const int32_t* HWY_RESTRICT row) {
    const hn::CappedTag<int32_t, 16> d;
    const auto masked = hn::Set(d, masked_sample<int32_t>);
    uint64_t found = 0;
    for (size_t i = 0; i < tile_samples; i += hn::Lanes(d)) {
        uint8_t bits[8] = {};
        hn::StoreMaskBits(d, hn::Eq(hn::LoadU(d, row + i), masked), bits);
        found |= (uint64_t(bits[0]) | uint64_t(bits[1]) << 8) << i;
    }
    return found;
}

template <size_t sums_at_once, class D>
HWY_INLINE void sum_some(D d, const float* HWY_RESTRICT weights, size_t rows, const float* HWY_RESTRICT tile,
                         float* HWY_RESTRICT sums) {
    auto sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
    for (size_t row = 0; row < rows; ++row) {
        const auto y = hn::Load(d, tile + row * tile_samples);
        sum0 = hn::Add(sum0, hn::Mul(y, hn::Set(d, weights[row])));
        if constexpr (sums_at_once == 4) {
            sum1 = hn::Add(sum1, hn::Mul(y, hn::Set(d, weights[rows + row])));
            sum2 = hn::Add(sum2, hn::Mul(y, hn::Set(d, weights[2 * rows + row])));
            sum3 = hn::Add(sum3, hn::Mul(y, hn::Set(d, weights[3 * rows + row])));
        }
    }
    hn::Store(sum0, d, sums);
    if constexpr (sums_at_once == 4) {
        hn::Store(sum1, d, sums + tile_samples);
        hn::Store(sum2, d, sums + 2 * tile_samples);
        hn::Store(sum3, d, sums + 3 * tile_samples);
    }
}

void sum_rows_by_weight(const float* weights, size_t count, size_t rows, const float* tile, uint64_t samples,
                        float* sums) {
    const hn::CappedTag<float, tile_samples> d;
    const size_t lanes = hn::Lanes(d);
    const uint64_t whole = (uint64_t(1) << lanes) - 1;
    for (size_t i = 0; i < tile_samples; i += lanes) {
        if (((samples >> i) & whole) == 0) continue;
        size_t k = 0;
        for (; k + 4 <= count; k += 4) sum_some<4>(d, weights + k * rows, rows, tile + i, sums + k * tile_samples + i);
        for (; k < count; ++k) sum_some<1>(d, weights + k * rows, rows, tile + i, sums + k * tile_samples + i);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(find_masked);
HWY_EXPORT(sum_rows_by_weight);

uint64_t masked_samples(const int32_t* row) {
    return HWY_DYNAMIC_DISPATCH(find_masked)(row);
}

void sum_weighted_rows(std::span<const float> weights, size_t rows, const float* tile, uint64_t samples, float* sums) {
    HWY_DYNAMIC_DISPATCH(sum_rows_by_weight)(weights.data(), weights.size() / rows, rows, tile, samples, sums);
}

}  // namespace ols
#endif
