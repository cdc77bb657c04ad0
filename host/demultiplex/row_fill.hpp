// SPDX-License-Identifier: MIT
// Row fill: for one set of masked rows, the values that stand in for them as sums over the other rows, and what that costs in
// noise and in bias. demultiplex/fill_model.hpp has the method.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "demultiplex/fill_model.hpp"

namespace ols {

enum class FillKind : uint8_t {
    none,       // nothing was masked
    solved,     // the other rows determine every image
    estimated,  // they and the prior do
    clipped,    // of a sample only: they do not, and saturated rows count as they were read
    unsolved,   // they do not, and no prior was asked for; or nothing is left
};

struct RowFill {
    FillKind kind = FillKind::none;
    std::vector<int> masked;  // rows, ascending
    // [k * rows + row], 0 where `row` is masked: value of masked[k] = sum over rows of weight * row. Empty when unsolved.
    std::vector<float> weights;
    // 1 less the sum of a masked row's weights: what is to be added of a constant that lies on every row and is no light.
    std::vector<float> offset_share;

    // Noise variance of what is recovered over that of the whole basis, rows of equal noise: mean and worst over images.
    double noise_gain = 1, worst_noise_gain = 1;

    // The power function of the estimate (Wendland, "Scattered Data Approximation", 2005, section 11.1): |error of image i|
    // <= power * sqrt(B^2 - |estimate|_K^2) for every x with |x|_K <= B, |x|_K^2 = x' K^-1 x, apart from noise. No other
    // function of the same rows has a lower bound (Micchelli and Rivlin, "A survey of optimal recovery", 1977). It is also
    // the posterior deviation over tau. Root mean square and worst over images; 0 when solved.
    double power = 0, worst_power = 0;
};

// `masked` ascending, at least one. Cost for m masked of n rows: some m^3 / 3 + 2 m^2 n multiplications.
RowFill row_fill(const FillModel& model, const std::vector<int>& masked, Estimate estimate);

// The power function of each image; zeros when the set is solved. Meant for tests and reports.
Eigen::VectorXd power_function(const FillModel& model, const std::vector<int>& masked);

}  // namespace ols
