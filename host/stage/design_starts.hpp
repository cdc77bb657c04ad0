// SPDX-License-Identifier: MIT
// Where the search for a basis begins: combinatorial designs that are optimal somewhere, and cyclic ones.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "stage/design_problem.hpp"

namespace ols {

struct DesignStart {
    std::string name;
    Light light;  // rows x lamps
};

// A symmetric block design: v rows over v lamps, each lighting k lamps, any two of them `common` same ones. Of all
// matrices with k lamps lit a row these leave least noise (Ratner, Schechner and Goldberg, "Optimal multiplexed sensing",
// Optics Express 15, 2007: strongly regular graphs), whatever the noise, as long as all lamps are alike.
struct BlockDesign {
    std::string name;
    int v = 0, k = 0;
    Light light;
};

// The designs with at most `rows` rows, smallest first:
//   points and hyperplanes of the projective space PG(d, q), q prime: v = (q^(d+1) - 1) / (q - 1), k = (q^d - 1) / (q - 1)
//     (J. Singer 1938). PG(3, 5) has exactly the 156 points of a stage's lamps, 31 on a plane, 6 on any two planes;
//   cyclic difference sets: the planes PG(2, 4), PG(2, 8), PG(2, 9) and the fourth powers modulo 37;
//   Paley's from squares modulo a prime v = 3 mod 4 and its double (the S-matrices, as basis s159).
std::vector<BlockDesign> block_designs(int rows);

// Row r lights the lamps r + S modulo `rows`, S a set of `lit` numbers; the columns beyond the lamps are left out. The noise
// of such a cyclic light is the sum of 1 / |f|^2 over the Fourier coefficients f of S (Wuttig, "Optimal transformations for
// optical multiplex measurements in the presence of photon noise", Applied Optics 44, 2005), which moving one number of S
// at random lowers step by step.
Light cyclic_light(int rows, int lamps, int lit, std::mt19937_64& random);

// Single lamps; designs of at least as many points as lamps, without the columns too many, and what they leave dark;
// smaller ones side by side, each for its own share of the lamps, so that few lamps are lit at a time; cyclic lights. Rows
// beyond a start's own repeat it from its beginning. A row that is too bright is dimmed (grey), or loses lamps:
// first the one that adds most to what is too bright. Lamps are dealt to columns in an order of `seed`.
std::vector<DesignStart> design_starts(const DesignProblem& problem, bool grey, uint64_t seed);

}  // namespace ols
