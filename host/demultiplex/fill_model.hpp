// SPDX-License-Identifier: MIT
// Fill model: what a basis says about a row that has no count, and what a prior says where the basis cannot.
//
// Rows y = P x + noise, x the images of n lamps, W the basis's left inverse. A masked row is filled with the value that
// makes the whole, unchanged inversion W give what the rows that are left say:
//  - Least squares. (I - H) y, H = P P^+, is what no x explains. Choosing the masked values y_M that make |(I - H) y|^2
//    least is ordinary least squares on the other rows: the residual in M vanishes, and (P' P)^-1 P' of the filled rows is
//    (P_rest' P_rest)^-1 P_rest' of the rest. I - H has rank d = rows - rank: d masked rows can be solved at most, and a set
//    M is solvable when (I - H)_MM is regular.
//  - Where it is not, the values that are left free make x' K^-1 x least, x = W y: minimum-norm interpolation under the
//    prior x ~ N(0, tau^2 K) (Rasmussen and Williams, "Gaussian Processes for Machine Learning", 2006, sections 2.2 and 6.2),
//    in which what the rows do determine is not shrunk, for it is not free.
// Both are one quadratic form in y, minimised over y_M alone. Rows count alike: weights by the noise model change the
// variance of what is recovered by 0.02 % (docs/demultiplexing.md), less than rounding a sample to whole counts does.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "stage/row_losses.hpp"

namespace ols {

// Where what is left of the rows does not determine the images.
enum class Estimate {
    none,         // the pixel is not solved
    smooth,       // neighbouring lamps give similar values: SmoothPrior
    nonnegative,  // smooth, no value below zero, no saturated sample below white (demultiplex/bounded_fill.hpp)
    clipped,      // no prior: saturated samples count as they were read, each a lower bound
};

// none, smooth, nonnegative, clipped: in the order of Estimate.
const std::vector<std::string>& estimate_names();
const std::string& estimate_name(Estimate estimate);
// Nothing where there is no estimate of that name.
std::optional<Estimate> estimate_named(const std::string& name);

// Whether lamps that are left free are taken from a prior.
constexpr bool has_prior(Estimate estimate) {
    return estimate == Estimate::smooth || estimate == Estimate::nonnegative;
}

// K(i, j) = (1 - single_share) exp((cos(angle between i and j) - 1) / length^2) + single_share [i = j]: a Gaussian of the
// angle for lamps close by, positive definite on the sphere where a Gaussian of the angle is not (Gneiting, "Strictly and
// non-strictly positive definite functions on spheres", 2013), and a share that one lamp has for itself: a highlight.
struct SmoothPrior {
    double length_rad = 0.6;     // two lamps' distance; from 0.3 to 1 the error hardly depends on it
    double single_share = 0.05;  // of the variance
};

// The kernel of lights in these directions (unit vectors).
Eigen::MatrixXd smooth_kernel(const std::vector<LightPosition>& lights, const SmoothPrior& prior);

struct FillModel {
    Eigen::MatrixXd inverse;   // W, images x rows
    Eigen::MatrixXd residual;  // I - H, rows x rows
    int redundancy = 0;        // d, the rank of `residual`
    Eigen::MatrixXd spread;    // W' W, rows x rows: what variances of rows become, summed over images
    // Of the prior, empty without one:
    Eigen::MatrixXd precision;  // K^-1, images x images
    Eigen::MatrixXd roughness;  // W' K^-1 W, rows x rows

    int rows() const { return int(inverse.cols()); }
    int images() const { return int(inverse.rows()); }
};

// Without a prior. In a basis that gives each row an image of its own (single, triangle) no row says anything of another:
// its redundancy is 0.
FillModel fill_model(const Basis& basis);

// `lights` are those of the images, image_lights() of the basis.
void add_smooth_prior(FillModel& model, const std::vector<LightPosition>& lights, const SmoothPrior& prior = {});

}  // namespace ols
