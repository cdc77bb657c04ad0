// SPDX-License-Identifier: MIT
// Bounded fill: estimates of one sample's masked rows that respect what is known beyond smoothness: no lamp gives less than
// nothing, and a saturated sample is no less than white.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "demultiplex/fill_model.hpp"

namespace ols {

struct FillBounds {
    double sigma_row = 1;       // noise of a row, counts
    std::vector<double> least;  // for each masked row the least that it can be; -infinity for a lost one
};

// Improves `rows` (all rows of one sample in counts, the masked ones filled by the smooth estimate) at `masked`, so that the
// estimate x = W y makes least
//   x' K^-1 x / tau^2 + |(I - H) y|^2 / s^2 + sum over images of min(0, x_i)^2 / s_x^2 + sum over masked of max(0, least - y)^2 / s^2
// with s the noise of a row and s_x that of an image: the posterior's mode under the prior cut off at zero, no sharper than
// noise allows; hard bounds leave no value at all, for half of the lamps are dark and noise makes some of those negative.
// tau^2 is the most likely for the smooth estimate, |x|_K^2 / images. The function is convex and piecewise quadratic: Newton's
// method on the active set (Mangasarian, "A finite Newton method for classification", 2002), each step halved until it descends.
void bound_fill(const FillModel& model, const std::vector<int>& masked, const FillBounds& bounds,
                Eigen::VectorXd& rows);

}  // namespace ols
