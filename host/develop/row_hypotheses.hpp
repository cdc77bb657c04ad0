// SPDX-License-Identifier: MIT
// Row hypotheses: which fault of a row the sums over a target's samples tell of (parity_witness.hpp has the method).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "develop/parity_sums.hpp"
#include "develop/parity_witness.hpp"

namespace ols {

// What the hypotheses of a target are judged by.
struct ParityEvidence {
    const Basis& basis;
    const Eigen::MatrixXd& checks;   // rows x d, of the rows that are not lost; 0 in those that are
    const Eigen::MatrixXd& inverse;  // images x rows; empty where an image is not a lamp
    const std::vector<StripSums>& strips;
    std::span<const int> lost_rows;
};

// Two rows that show the same picture, as no two others do.
std::optional<RowFinding> find_copied(const ParityEvidence& evidence);

// Two rows that show each other's picture.
std::optional<RowFinding> find_swapped(const ParityEvidence& evidence);

// A lamp that was out, or on, in one row.
std::optional<RowFinding> find_mislit(const ParityEvidence& evidence);

// The median of the values' distances from 0, as a normal deviation, at least 1.
double robust_spread(std::vector<double> values);

}  // namespace ols
