// SPDX-License-Identifier: MIT
// Estimate bound: how far from the truth the estimated samples of a target can be.
#pragma once

#include <span>

#include "demultiplex/row_filler.hpp"

namespace ols {

// The bound is for reflectance functions whose norm |x|_K (demultiplex/row_fill.hpp) is at most this many times the
// estimate's: a function rougher by more than that is outside of what the prior allows.
constexpr double norm_limit = 2;

struct EstimateFigures {
    size_t samples = 0;                        // estimated
    double worst_bias = 0, sum_of_biases = 0;  // bounds for the lamp where they are largest, in units of the images

    double mean_bias() const { return samples ? sum_of_biases / double(samples) : 0; }
};

// For every sample that was estimated: adds the prior's posterior variance, mean over images, to variance[p] (tau^2 power^2
// with tau^2 = |estimate|_K^2 / images, the most likely), and its bias bound to `figures`. With B = norm_limit |estimate|_K
// the smooth estimate, which has the least norm of all that agree with the rows, errs by power * sqrt(B^2 - |estimate|_K^2)
// at most; the non-negative one lies in the same ball but not in its middle, and errs by power * (B + |estimate|_K) at
// most. `images`: a pointer each, to as many samples as `fills` has. `variance` may be empty.
void judge_estimates(const FillModel& model, Estimate estimate, std::span<const SampleFill> fills,
                     std::span<const float* const> images, std::span<float> variance, EstimateFigures& figures);

}  // namespace ols
