// SPDX-License-Identifier: MIT
// The least squares inversion of any basis, and the figures of its matrix.
#pragma once

#include <vector>

#include "result.hpp"
#include "stage/basis.hpp"

namespace ols {

// Beyond this condition number a basis is refused: at 12-bit counts a relative error of 1e-4 in a lamp's level, which no
// lamp holds, would already move a result by 100 %.
constexpr double condition_max = 1e4;

// Singular values below this share of the largest count as zero: far above rounding, far below what a level's least bit makes.
constexpr double rank_tolerance = 1e-9;

struct MatrixFigures {
    int rank = 0;
    double condition = 0;                 // largest over smallest singular value that counts for the rank
    std::vector<double> singular_values;  // of light (level / level_max), largest first
};

MatrixFigures matrix_figures(const Basis& basis);

// Gives the basis one image a lamp that is lit, and the pseudo-inverse of its light (Golub and Van Loan, "Matrix
// Computations", 4th ed., 5.5.2) as its inversion. With singular values that count as zero the images are an estimate
// (is_estimate), the shortest vector of lamps that explains the rows. Error: a condition number above condition_max, with
// advice.
Result<Basis> with_least_squares(Basis basis);

}  // namespace ols
