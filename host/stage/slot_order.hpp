// SPDX-License-Identifier: MIT
// In which order a basis's rows play: such that the others make up for rows that are lost together, and with each lamp's light
// spread evenly over the cycle (Wenger 5.2).
#pragma once

#include <vector>

#include "stage/basis.hpp"

namespace ols {

// The row that stands at each of `places`: slot numbers of a cycle of `slots` slots, ascending, one for each row.
//
// First of all, what is lost in a hiccup is neighbouring rows. As few neighbours as swaps of two rows reach are such that the other rows do
// not make up for the two (stage/row_losses.hpp); then as few threes in a row and pairs at distance two. The last row's neighbour is the
// first. A basis that cannot spare two rows has no say in this, nor one whose rows are images of their own.
//
// Among orders that are equal in that, least is the sum over lamps of the periodic L2 discrepancy of the lamp's light over the cycle:
// with X(k) the Fourier coefficients of its light, sum over k >= 1 of |X(k) / X(0)|^2 / k^2. It is what flickers slowest, and so is
// seen most, that counts most. All lamps together count as much as the mean of them one by one. Only the rows' inner products and the
// distances of places matter: with B2 the Bernoulli polynomial, cos(2 pi k d) / k^2 summed over k is pi^2 B2(d), so this is a
// quadratic assignment. All in whole numbers: the order is the same on every machine.
//
// It begins with row p * q mod rows at place p, q coprime to the rows and nearest to rows / golden ratio, which keeps neighbouring
// lamps from lighting in turn, and swaps pairs of rows while that helps. No swap makes light more even where every lamp lights
// alone, nor, but for columns that are left out, in an S-matrix, whose rows have the same inner products.
std::vector<int> spread_rows(const Basis& basis, const std::vector<int>& places, int slots);

}  // namespace ols
