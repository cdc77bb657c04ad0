// SPDX-License-Identifier: MIT
// Row losses: which rows of a basis may be lost because the others still determine every image, and what that costs in noise.
//
// Rows y = P x + noise, H = P P^+. I - H, the projector on what no x explains, has rank d = rows - rank: d lost rows can be made
// up for at most, and a set M when (I - H)_MM is regular. Least squares on the rows that are left then has the covariance
// W W' + W_M (I - H)_MM^-1 W_M', W = P^+ (Woodbury's formula for (P' P - P_M' P_M)^-1). How a lost row is filled in:
// demultiplex/fill_model.hpp.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "stage/basis.hpp"

namespace ols {

// Whether each image rests on its own row alone, so that a lost row takes one image with it and no row says anything of another.
bool is_one_image_a_row(const Basis& basis);

// I - H and its rank; zero in a basis that gives each row an image of its own.
struct RowResidual {
    Eigen::MatrixXd projector;  // rows x rows
    int redundancy = 0;         // d
};

RowResidual row_residual(const Basis& basis);

// The parity checks of a basis: sums over the rows, a column each, that are 0 whatever its lamps light. An orthonormal basis of the
// left null space of the levels, rows x d. Of any basis: also of one whose images are not inverted, as triangles.
Eigen::MatrixXd parity_checks(const Basis& basis);

// A pivot of (I - H)_MM below this is rounding, as the largest entry is about d / rows: the set M is not solvable.
constexpr double pivot_least = 1e-9;

// Beyond ten times the noise an order of play counts a set of rows as lost, and so do reports. A take that loses it is solved all the
// same, and its noise gain tells at what cost.
constexpr double bearable_noise_gain = 100;

class RowLosses {
  public:
    static constexpr size_t rows_max = 3;  // of a set

    explicit RowLosses(const Basis& basis);

    int rows() const { return int(residual_.projector.rows()); }
    int redundancy() const { return residual_.redundancy; }

    // Mean variance of the images from all rows but these (different ones, at most rows_max), over that from all, where rows have
    // equal noise; infinite where the others do not determine every image.
    double noise_gain(std::span<const int> rows) const;
    bool makes_up_for(std::span<const int> rows) const { return noise_gain(rows) <= bearable_noise_gain; }

    // The class of each row, counted from 0 in the order of their first rows; -1 for a row that the others do not determine even
    // alone. The loss of two rows of one class cannot be made up for at any cost in noise, that of two of different classes
    // can. There are such classes in any basis: with I - H = N N', two rows cannot both be spared where their rows of N are
    // parallel.
    std::vector<int> classes() const;

  private:
    RowResidual residual_;
    Eigen::MatrixXd spread_;  // W' W over its trace
};

}  // namespace ols
