// SPDX-License-Identifier: MIT
// Fill sums: the weighted sums over a tile's rows that stand in for its masked samples. SIMD by Highway, chosen at run time;
// every path gives the same bits, for each sum adds its rows in order and products are not fused.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "demultiplex/planes.hpp"

namespace ols {

// Bit i: sample i of a row of tile_samples is masked.
uint64_t masked_samples(const int32_t* row);

// sums[k * tile_samples + i] = sum over rows of weights[k * rows + row] * tile[row * tile_samples + i], in float, at least
// for the samples i whose bit is set. `tile` and `sums` are aligned to 64 bytes.
void sum_weighted_rows(std::span<const float> weights, size_t rows, const float* tile, uint64_t samples, float* sums);

}  // namespace ols
