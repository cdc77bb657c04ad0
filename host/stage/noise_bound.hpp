// SPDX-License-Identifier: MIT
// How little noise any basis can leave.
#pragma once

#include "stage/stage.hpp"

namespace ols {

struct BoundProblem {
    int lamps = 0, rows = 0;
    double lamp_counts = 0;  // of every lamp at full level, alike
    NoiseModel noise;
    double brightness_max = 0;  // the sum of levels of a row; 0: no limit
};

// A lower bound on the mean variance of the lamps, in squared counts, over all bases of levels from 0 to 1 and all their
// unbiased inversions, and the sum of levels c at which it lies.
//
// With F = sum over rows of p p' / s(c), s(c) = sigma^2(c counts), no inversion leaves less than tr F^-1 (Gauss and Markov). Let u be
// the direction of all lamps alike: u'Fu = sum of c^2 / (n s), and tr F <= sum of c / s since p_i^2 <= p_i. Averaging F over
// rotations of the rest keeps both and lowers tr F^-1 (convexity), so tr F^-1 >= 1 / u'Fu + (n - 1)^2 / (tr F - u'Fu).
// Each row adds at most max h = c^2 / (n s) to the one and max g = (c - c^2 / n) / s to the other:
//   mean variance >= (1 / max h + (n - 1)^2 / max g) / (rows n).
// It is the bound of Ratner, Schechner and Goldberg (2007) for rows that differ in c, grey levels and any number of rows.
// It is reached where a symmetric block design has just the best c (the term of h aside, which is of order 1 / n^2).
struct NoiseBound {
    double mean_variance = 0, lit = 0;
};

NoiseBound noise_bound(const BoundProblem& problem);

// The least that Hadamard's way of lighting half the lamps could leave, and any other: the bound for rows of just `lit`.
double noise_bound_at(const BoundProblem& problem, double lit);

}  // namespace ols
