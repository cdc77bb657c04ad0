// SPDX-License-Identifier: MIT
// The bound, by looking at every sum of levels in hundredths of a lamp.
#include "stage/noise_bound.hpp"

#include <algorithm>

#include "stage/basis_noise.hpp"

namespace ols {

namespace {

// What a row of c lamps' light adds to the information on all lamps alike, and on what tells them apart.
struct Information {
    double alike, apart;
};

Information row_information(const BoundProblem& problem, double c) {
    const double variance = noise_variance_at(problem.noise, c * problem.lamp_counts);
    return {c * c / problem.lamps / variance, (c - c * c / problem.lamps) / variance};
}

double mean_variance(const BoundProblem& problem, const Information& row) {
    const double n = problem.lamps;
    return (1 / row.alike + (n - 1) * (n - 1) / row.apart) / (n * problem.rows);
}

}  // namespace

NoiseBound noise_bound(const BoundProblem& problem) {
    const double most =
        problem.brightness_max > 0 ? std::min(problem.brightness_max, double(problem.lamps)) : double(problem.lamps);
    constexpr double step = 0.01;
    Information best{0, 0};
    NoiseBound bound;
    for (double c = step; c < most + step / 2; c += step) {
        const Information row = row_information(problem, std::min(c, most));
        if (row.apart > best.apart) bound.lit = std::min(c, most);
        best = {std::max(best.alike, row.alike), std::max(best.apart, row.apart)};
    }
    bound.mean_variance = mean_variance(problem, best);
    return bound;
}

double noise_bound_at(const BoundProblem& problem, double lit) {
    return mean_variance(problem, row_information(problem, lit));
}

}  // namespace ols
