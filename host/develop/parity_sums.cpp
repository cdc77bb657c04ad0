// SPDX-License-Identifier: MIT
// Strips on several threads, in blocks of samples that stay in the nearer caches; the product of rows and rows by OpenBLAS.
#include "develop/parity_sums.hpp"

#include <cblas.h>

#include <algorithm>
#include <span>

#include "parallel.hpp"

namespace ols {

namespace {

// The part of |z|^2 / d, beside the noise, that a sample's weight counts: of a swap it costs little, as its factor is the same for all
// weights, and of motion it leaves outlines less to say.
constexpr double residual_share = 0.3;

constexpr Eigen::Index block_samples = 64;  // 159 rows of these are 81 KB in double

// Some samples of a strip: to the sums, and to the columns of `centred`, sqrt(w) (y - m).
void add_block(const ParitySamples& samples, std::span<const Eigen::Index> block, const Eigen::MatrixXd& checks,
               StripSums& sums, Eigen::Ref<Eigen::MatrixXf> centred) {
    const Eigen::MatrixXd counts = samples.counts()(Eigen::all, block).cast<double>();
    const Eigen::ArrayXd variance = samples.variance()(block).cast<double>();
    const Eigen::MatrixXd z = checks.transpose() * counts;
    const Eigen::ArrayXd squares = z.colwise().squaredNorm().array();
    const Eigen::ArrayXd weights = (variance + squares * (residual_share / double(checks.cols()))).inverse();
    const Eigen::MatrixXd weighted = z * weights.matrix().asDiagonal();
    sums.check_rows.noalias() += weighted * counts.transpose();
    sums.checks.noalias() += weighted * z.transpose();
    sums.noise += (weights * variance).sum();
    sums.chi_square += (squares / variance).sum();
    const Eigen::RowVectorXd means = counts.colwise().mean();
    const Eigen::ArrayXd weighted_means = weights * means.transpose().array();
    sums.mean_square += (weighted_means * means.transpose().array()).sum();
    const Eigen::MatrixXd off = counts.rowwise() - means;
    sums.mean_rows.noalias() += off * weighted_means.matrix();
    centred = (off * weights.sqrt().matrix().asDiagonal()).cast<float>();
}

StripSums sums_of(const ParitySamples& samples, std::span<const Eigen::Index> strip, const Eigen::MatrixXd& checks) {
    const Eigen::Index rows = samples.counts().rows(), count = Eigen::Index(strip.size());
    StripSums sums;
    sums.samples = strip.size();
    sums.rows = Eigen::MatrixXf::Zero(rows, rows);
    sums.mean_rows = Eigen::VectorXd::Zero(rows);
    sums.check_rows = Eigen::MatrixXd::Zero(checks.cols(), rows);
    sums.checks = Eigen::MatrixXd::Zero(checks.cols(), checks.cols());
    Eigen::MatrixXf centred(rows, count);
    for (Eigen::Index first = 0; first < count; first += block_samples) {
        const Eigen::Index size = std::min(block_samples, count - first);
        add_block(samples, strip.subspan(size_t(first), size_t(size)), checks, sums, centred.middleCols(first, size));
    }
    if (count > 0)
        cblas_ssyrk(CblasColMajor, CblasLower, CblasNoTrans, int(rows), int(count), 1, centred.data(), int(rows), 0,
                    sums.rows.data(), int(rows));
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
