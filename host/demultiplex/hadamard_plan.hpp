// SPDX-License-Identifier: MIT
// Hadamard plan: the inversion of a Hadamard basis as few additions, with an identity that certifies short arithmetic.
//
// z = H' y or its negative, with y the row images (0 for a row of H that is no slot). Every lamp is the basis's scale
// times one z. z(0), that of the column of ones, is the sum of all y up to its sign, and much larger than the others.
#pragma once

#include <optional>
#include <vector>

#include "demultiplex/hadamard_codelets.hpp"
#include "stage/basis.hpp"

namespace ols {

// In steps, which 16-bit arithmetic takes: from the rows to places by pairs, from there by codelets to z.
struct HadamardPlan {
    struct Pair {
        int first, second;    // rows
        int sum, difference;  // places
    };
    struct Single {
        int row;
        int place, negated;  // places, of the row and of its negative
    };
    struct Step {
        Codelet codelet;
        int from, to;  // the places of its first input and output
    };
    int rows = 0, order = 0;  // order: n, with H H' = n I, so that the sum of all z^2 is n times the sum of all y^2
    std::vector<Pair> pairs;
    std::vector<Single> singles;
    std::vector<Step> steps;
    int places = 0;
    std::vector<int> outputs;  // places where z(1)..z(n-1) come to lie

    std::vector<int> lamp_output;  // by lamp: its k, or 0 for the sum of all rows
    // The lamp with output 0, if there is one, is the sum of all rows plus `extra_weight` times row `extra_row`.
    int extra_row = 0, extra_weight = 0;

    SumPlan whole{0};  // all steps as one plan, whose outputs are z(1)..z(n-1)
    SumCode code;      // the same laid out
};

// Nothing for a basis whose structure is not known: `single`, any from a file, and one that only has a known name, for
// the plan's matrix is compared with the basis's weights.
std::optional<HadamardPlan> hadamard_plan(const Basis& basis);

}  // namespace ols
