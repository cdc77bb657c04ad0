// SPDX-License-Identifier: MIT
// Strips on several threads; the product of rows and rows by OpenBLAS.
#include "develop/parity_sums.hpp"

#include <cblas.h>

#include <algorithm>
#include <cmath>

#include "parallel.hpp"

namespace ols {

namespace {

// The part of |z|^2 / d, beside the noise, that a sample's weight counts: of a swap it costs little, as its factor is the same for all
// weights, and of motion it leaves outlines less to say.
constexpr double residual_share = 0.3;

StripSums sums_of(const ParitySamples& samples, const std::vector<Eigen::Index>& strip, const Eigen::MatrixXd& checks) {
    const Eigen::Index rows = samples.counts().rows(), d = checks.cols();
    StripSums sums;
    sums.samples = strip.size();
    sums.rows = Eigen::MatrixXf::Zero(rows, rows);
    sums.mean_rows = Eigen::VectorXd::Zero(rows);
    sums.check_rows = Eigen::MatrixXd::Zero(d, rows);
    sums.checks = Eigen::MatrixXd::Zero(d, d);
    Eigen::MatrixXf centred(rows, Eigen::Index(strip.size()));
    for (size_t k = 0; k < strip.size(); ++k) {
        const Eigen::VectorXd counts = samples.counts().col(strip[k]).cast<double>();
        const double variance = double(samples.variance()(strip[k])), mean = counts.mean();
        const Eigen::VectorXd z = checks.transpose() * counts;
        const double weight = 1 / (variance + residual_share * z.squaredNorm() / double(d));
        const Eigen::VectorXd off = counts.array() - mean;
        centred.col(Eigen::Index(k)) = (std::sqrt(weight) * off).cast<float>();
        sums.mean_rows += weight * mean * off;
        sums.mean_square += weight * mean * mean;
        sums.check_rows.noalias() += weight * z * counts.transpose();
        sums.checks.noalias() += weight * z * z.transpose();
        sums.noise += weight * variance;
        sums.chi_square += z.squaredNorm() / variance;
    }
    if (!strip.empty())
        cblas_ssyrk(CblasColMajor, CblasLower, CblasNoTrans, int(rows), int(strip.size()), 1, centred.data(), int(rows),
                    0, sums.rows.data(), int(rows));
    return sums;
}

}  // namespace

std::vector<StripSums> parity_sums(const ParitySamples& samples, const Eigen::MatrixXd& checks, int threads) {
    std::vector<std::vector<Eigen::Index>> strips(parity_strips);
    for (size_t k = 0; k < samples.size(); ++k)
        if (samples.variance()(Eigen::Index(k)) > 0)
            strips[size_t(samples.strip_of(k, parity_strips))].push_back(Eigen::Index(k));
    openblas_set_num_threads(1);  // strips are what runs in parallel
    std::vector<StripSums> sums(strips.size());
    for_each_index(threads, strips.size(), [&](size_t s) { sums[s] = sums_of(samples, strips[s], checks); });
    return sums;
}

}  // namespace ols
