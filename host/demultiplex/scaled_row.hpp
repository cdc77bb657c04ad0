// SPDX-License-Identifier: MIT
// Scaled row: one row of a basis whose rows each show an image by itself, made that image.
#pragma once

#include <cstddef>

namespace ols {

struct RowScale {
    double weight;         // of the row in its image
    const float* factors;  // one a sample
    const float* offsets;  // one a sample; null: none
};

// out[p] = float(weight * row[p]) * factors[p] - offsets[p], the first product in double; |row[p]| < 2^23 for integers. Where `out`
// begins at a multiple of 64 bytes and float holds the weight, it is written past the caches. Sample: int16_t, int32_t or
// float. The same bits on every SIMD path.
template <typename Sample>
void scale_row(const Sample* row, size_t samples, const RowScale& scale, float* out);

}  // namespace ols
