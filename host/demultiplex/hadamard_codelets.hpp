// SPDX-License-Identifier: MIT
// Hadamard codelets: the parts of the structured inversions that are compiled, each sum a statement. `print_codelets`
// writes them as C++ when the project is built (as FFTW makes its codelets: M. Frigo, "A fast Fourier transform
// compiler", 1999), for a list of sums that is read while it runs costs three times as long.
#pragma once

#include <array>

#include "demultiplex/sum_plan.hpp"

namespace ols {

enum class Codelet { paley_80, williamson_even, williamson_odd, williamson_merge };

inline constexpr std::array codelets = {Codelet::paley_80, Codelet::williamson_even, Codelet::williamson_odd,
                                        Codelet::williamson_merge};

const char* codelet_name(Codelet codelet);

// What the codelet computes:
//
// paley_80          -P' u for the normalised Paley matrix P of order 80 (stage/hadamard.hpp).
// williamson_*      W' y in three parts, for the Williamson array W of four circulants of order 39, with the signs of
//                   rows and columns that normalise it. Blocks are split: part b * 20 + j, j = 1..19, is the even or the
//                   odd one of inputs j and 39 - j of block b, up to the sign of row j; part b * 20 is input 0 itself.
//                   Even: 80 parts to the even parts of the outputs but column 0, the sum of all. Odd: 80 parts, of
//                   which part b * 20 is not used, to 76. Merge: these, one after the other, to columns 1..155.
const SumPlan& codelet_plan(Codelet codelet);

}  // namespace ols
