// SPDX-License-Identifier: MIT
// The search for a basis of least noise: descent over grey levels, exchange over levels that lamps have.
#pragma once

#include <functional>
#include <string>

#include "stage/design_problem.hpp"

namespace ols {

struct DesignOptions {
    bool grey = false;         // 8-bit levels; else on or off
    uint64_t seed = 1;         // of the random starts
    int starts = 3;            // how many of them, the best before any work, are worked on
    int descent_steps = 300;   // of the gradient, a start
    int exchange_sweeps = 30;  // over all rows, a start
};

struct Design {
    Light light;        // whole levels over level_max
    int level_max = 1;  // 1 or 255
    double cost = 0;    // design_cost() of it
    std::string start;  // from which it came
};

// Reached so far, 0 to 1, and the best cost.
using DesignProgress = std::function<void(double share, double cost)>;

// Spectral projected gradient over levels from 0 to 1 (Birgin, Martinez and Raydan, SIAM J. Optim. 10, 2000: steps of
// Barzilai and Borwein, a line search that may rise within the last 10 costs). Returns the best light seen.
Light descend(const DesignProblem& problem, const Light& start, int steps);

// Lamp by lamp: the best change of one level of a row, or of one lamp lit for another, until none helps (coordinate
// exchange, Meyer and Nachtsheim, Technometrics 37, 1995). A change's effect on the cost is exact for the mean (a change
// of two rank-one terms, by the formula of Woodbury) and of first order for the worst lamp, where a sweep that made the
// true cost worse is taken back. Levels stay multiples of 1 / level_max.
Light exchange(const DesignProblem& problem, const Light& start, int level_max, int sweeps);

// The best of the starts (design_starts.hpp) after descent (grey only) and exchange. Deterministic: it depends on the
// problem and the options alone. Errors: rows fewer than lamps, limits that no start fulfils.
Result<Design> design_basis(const DesignProblem& problem, const DesignOptions& options, const DesignProgress& progress);

// The design as a basis, inverted by least squares without weights: all of a design's rows have about the same noise,
// and what weights would gain is the difference to Design::cost.
Result<Basis> basis_of(const Design& design, const std::string& name);

}  // namespace ols
