// SPDX-License-Identifier: MIT
// Norms of estimates, a few dozen samples at a time so that the matrix product is one of matrices.
#include "demultiplex/estimate_bound.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace ols {

namespace {

constexpr size_t batch = 64;

}  // namespace

void judge_estimates(const FillModel& model, Estimate estimate, std::span<const SampleFill> fills,
                     std::span<const float* const> images, std::span<float> variance, EstimateFigures& figures) {
    std::vector<size_t> samples;
    for (size_t p = 0; p < fills.size(); ++p)
        if (fills[p].kind == FillKind::estimated) samples.push_back(p);
    const double reach = estimate == Estimate::smooth ? std::sqrt(norm_limit * norm_limit - 1) : norm_limit + 1;
    for (size_t first = 0; first < samples.size(); first += batch) {
        const size_t count = std::min(batch, samples.size() - first);
        Eigen::MatrixXd x(model.images(), Eigen::Index(count));
        for (Eigen::Index i = 0; i < x.rows(); ++i)
            for (size_t k = 0; k < count; ++k) x(i, Eigen::Index(k)) = images[size_t(i)][samples[first + k]];
        const Eigen::VectorXd squares = (x.array() * (model.precision * x).array()).colwise().sum().transpose();
        for (size_t k = 0; k < count; ++k) {
            const size_t p = samples[first + k];
            const double square = squares(Eigen::Index(k)), bias = fills[p].worst_power * reach * std::sqrt(square);
            if (!variance.empty()) variance[p] += float(square / model.images() * fills[p].power * fills[p].power);
            figures.worst_bias = std::max(figures.worst_bias, bias);
            figures.sum_of_biases += bias;
        }
        figures.samples += count;
    }
}

}  // namespace ols
