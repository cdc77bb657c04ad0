// SPDX-License-Identifier: MIT
// What a camera's noise becomes in the images that a basis recovers.
#pragma once

#include <span>
#include <vector>

#include "stage/basis.hpp"
#include "stage/stage.hpp"

namespace ols {

// sigma(mu)^2 in counts squared, mu in counts above black. Below black there is only read noise.
double noise_variance_at(const NoiseModel& noise, double counts);

// Variance of each recovered image (basis.images() of them), in squared counts of a lamp at full level, where lamp i
// alone gives `lamp_counts[i]` (as many as basis.lamps) above black: the slots' noises are independent, so it is the sum
// over rows of inverse(row, image)^2 sigma(mu_row)^2, with mu_row = sum of light(row, lamp) lamp_counts[lamp].
std::vector<double> image_variances(const Basis& basis, std::span<const double> lamp_counts, const NoiseModel& noise);

// Counts of the brightest row.
double brightest_row_counts(const Basis& basis, std::span<const double> lamp_counts);

}  // namespace ols
