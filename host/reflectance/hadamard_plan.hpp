// SPDX-License-Identifier: MIT
// Hadamard plan: the inversion of a Hadamard basis as few additions, with an identity that certifies short arithmetic.
//
// z = H' y or its negative, with y the row images (0 for a row of H that is no slot). Every lamp is the basis's scale
// times one z. That of the column of ones, the sum of all y, is much larger than the others.
#pragma once

#include <optional>
#include <vector>

#include "reflectance/sum_plan.hpp"
#include "stage/basis.hpp"

namespace ols {

struct HadamardPlan {
    SumPlan plan{
        0};         // inputs: the basis's rows; outputs: all z but that of the column of ones, in order of H's columns
    int order = 0;  // n, with H H' = n I, so that the sum of all z^2 is n times the sum of all y^2
    std::vector<int> lamp_output;  // by lamp: the output that it is, or -1 for the sum of all rows
    // The lamp with output -1, if there is one, is the sum of all rows plus `extra_weight` times row `extra_row`.
    int extra_row = 0, extra_weight = 0;
};

// Nothing for a basis whose structure is not known: `single`, any from a file, and one that only has a known name, for
// the plan's matrix is compared with the basis's weights.
std::optional<HadamardPlan> hadamard_plan(const Basis& basis);

}  // namespace ols
