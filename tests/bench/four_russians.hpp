// SPDX-License-Identifier: MIT
// The peer of the structured inversion that needs no structure: the method of the four Russians (V. Arlazarov et al., "On
// economical construction of the transitive closure of a directed graph", 1970).
#pragma once

#include <span>

#include "stage/basis.hpp"

namespace ols {

// Rows in groups of eight: all 256 signed sums of a group by one addition each, then one addition a group and lamp. In
// 16 bits that wrap unseen. For weights of +1 and -1; samples are a multiple of 32.
void invert_by_four_russians(const Basis& basis, std::span<int16_t* const> rows, size_t samples,
                             std::span<float* const> lamps);

}  // namespace ols
