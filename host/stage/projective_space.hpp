// SPDX-License-Identifier: MIT
// Finite projective spaces, whose points and hyperplanes light lamps more evenly than anything else can.
#pragma once

#include <vector>

namespace ols {

// One vector for each point of PG(d, q), q prime: those of GF(q)^(d+1) whose first element that is not 0 is 1. There are
// (q^(d+1) - 1) / (q - 1) of them; no more than `most` + 1 are listed.
std::vector<std::vector<int>> projective_points(int dimension, int q, int most);

// Whether a point lies on the hyperplane that has another point's vector as its normal.
bool lies_on(const std::vector<int>& point, const std::vector<int>& plane, int q);

}  // namespace ols
