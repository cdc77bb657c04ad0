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
    const Eigen::Index rows = samples.counts().rows();
    StripSums sums;
    sums.samples = strip.size();
    sums.rows = Eigen::MatrixXf::Zero(rows, rows);
    const Eigen::MatrixXd counts = samples.counts()(Eigen::all, strip).cast<double>();
    const Eigen::ArrayXd variance = samples.variance()(strip).cast<double>();
    const Eigen::MatrixXd z = checks.transpose() * counts;
    const Eigen::ArrayXd squares = z.colwise().squaredNorm().array();
    const Eigen::ArrayXd weights = (variance + squares * (residual_share / double(checks.cols()))).inverse();
    const Eigen::MatrixXd weighted = z * weights.matrix().asDiagonal();
    sums.check_rows = weighted * counts.transpose();
    sums.checks = weighted * z.transpose();
    sums.noise = (weights * variance).sum();
    sums.chi_square = (squares / variance).sum();
    const Eigen::RowVectorXd means = counts.colwise().mean();
    sums.mean_square = (weights * means.transpose().array().square()).sum();
    const Eigen::MatrixXd off = counts.rowwise() - means;
    sums.mean_rows = off * (weights * means.transpose().array()).matrix();
    const Eigen::MatrixXf centred = (off * weights.sqrt().matrix().asDiagonal()).cast<float>();
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
