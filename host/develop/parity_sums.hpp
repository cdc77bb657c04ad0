// SPDX-License-Identifier: MIT
// Parity sums: products of checks and rows over the samples of a picture, strip by strip, from which every hypothesis is judged.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "develop/parity_samples.hpp"

namespace ols {

// Of one horizontal strip of the picture, a torn frame being one of several whole strips. w: the samples' weights.
struct StripSums {
    Eigen::MatrixXf
        rows;  // sum w (y - m)(y - m)', m the sample's mean over the rows: lower triangle, as differences need it
    Eigen::VectorXd mean_rows;   // sum w m (y - m)
    double mean_square = 0;      // sum w m^2
    Eigen::MatrixXd check_rows;  // sum w z y', d x rows
    Eigen::MatrixXd checks;      // sum w z z', d x d
    double noise = 0;            // sum w v: what counts as samples
    double chi_square = 0;       // sum |z|^2 / v
    size_t samples = 0;
};

constexpr int parity_strips = 8;

// `checks`: rows x d. Samples with no variance are left out.
std::vector<StripSums> parity_sums(const ParitySamples& samples, const Eigen::MatrixXd& checks, int threads);

}  // namespace ols
