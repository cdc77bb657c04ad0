// SPDX-License-Identifier: MIT
// What a designed basis is asked to do: recover every lamp with little noise, for a camera, a light level and limits.
#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/basis.hpp"
#include "stage/lamps.hpp"
#include "stage/stage.hpp"

namespace ols {

// Light is a matrix of rows (slots) over lamps, 0 to 1 of a lamp's full level.
using Light = Eigen::MatrixXd;

// Counts that each lamp gives alone at full level (subjects x lamps): the pixels that are expected, each as likely as the
// others.
//   equal   one subject that every lamp lights alike: what theory treats, and the hardest on multiplexing
//   cosine  matte surfaces whose normals are spread over the half sphere that the camera sees (+z): `counts` from a lamp
//           they face, less by the cosine, none from behind. About half of the lamps are dark for each.
Eigen::MatrixXd equal_subject(int lamps, double counts);
Eigen::MatrixXd cosine_subjects(const std::vector<LightPosition>& lamps, double counts, int normals = 64);

struct DesignProblem {
    Eigen::MatrixXd subjects;  // counts, subjects x lamps
    NoiseModel noise;
    int rows = 0;
    double worst = 0;            // 0: the mean variance of the lamps counts; 1: nearly the worst one alone
    double brightness_max = 0;   // the sum of levels of a row; 0: no limit
    double duty_max = 0.75;      // of the rows, in which a lamp may be lit; the boards' own limit
    Eigen::MatrixXd cards;       // what must not saturate: counts, cards x lamps; empty: no limit
    double white_counts = 4095;  // where it would

    int lamps() const { return int(subjects.cols()); }
};

// Exponent of the mean over lamps that stands for the worst lamp: the sixteenth root of 156 is 1.37, so it lies between
// 0.73 and 1 times the worst variance.
constexpr double worst_exponent = 16;

// How good a light is. A fixed inversion W that is best on average over the subjects is the weighted least squares one
// with the mean variance s_r of each row, and leaves C = (P' diag(1/s) P)^-1 as mean covariance (Gauss and Markov). The
// cost is (1 - worst) mean(C_ii) + worst mean(C_ii^16)^(1/16), in squared counts of a lamp at full level.
struct DesignCost {
    double cost = 0;                // infinite where the rank is too low
    Eigen::VectorXd row_variances;  // s_r
    Eigen::MatrixXd covariance;     // C
    Eigen::VectorXd lamp_weights;   // d cost / d C_ii
};

DesignCost design_cost(const DesignProblem& problem, const Light& light);

// d cost / d light, rows x lamps. With A = C diag(lamp_weights) C, from dC = -C dF C, F = P' diag(1/s) P:
//   d cost / d p_r = -2 A p_r / s_r + p_r' A p_r / s_r^2 ds_r/dp_r.
Light design_gradient(const DesignProblem& problem, const Light& light, const DesignCost& cost);

// Mean over the subjects of sigma^2 of a row that lights them with `row_counts` (one a subject).
double mean_variance(const NoiseModel& noise, const Eigen::VectorXd& row_counts);

// Whether each row is within brightness and saturation, and each lamp within its duty.
bool is_feasible(const DesignProblem& problem, const Light& light);

// The nearest light within 0 to 1, brightness and saturation of each row: Dykstra's alternating projections (R. Dykstra
// 1983; Boyle and Dykstra 1986), then scaled down by what the last of them still exceeds. Duty is left to the search.
Light nearest_feasible(const DesignProblem& problem, const Light& light);

// A basis's levels as light.
Light light_of(const Basis& basis);

// The share of the slot's exposure, at most 1, with which the brightest row is within brightness and saturation. An
// exposure of that share is the same as dimming all levels by it.
double exposure_share(const DesignProblem& problem, const Light& light);

// What single lamps, each slot used once and exposed in full, would leave: the figure to beat.
double single_cost(const DesignProblem& problem);

}  // namespace ols
