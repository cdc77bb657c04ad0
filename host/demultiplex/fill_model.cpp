// SPDX-License-Identifier: MIT
// The prior's form by Eigen's Cholesky factorisation.
#include "demultiplex/fill_model.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace ols {

const std::vector<std::string>& estimate_names() {
    static const std::vector<std::string> names = {"none", "smooth", "nonnegative", "clipped"};
    return names;
}

const std::string& estimate_name(Estimate estimate) {
    return estimate_names()[size_t(estimate)];
}

std::optional<Estimate> estimate_named(const std::string& name) {
    const auto found = std::ranges::find(estimate_names(), name);
    if (found == estimate_names().end()) return {};
    return Estimate(found - estimate_names().begin());
}

Eigen::MatrixXd smooth_kernel(const std::vector<LightPosition>& lights, const SmoothPrior& prior) {
    const auto n = Eigen::Index(lights.size());
    Eigen::MatrixXd kernel(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < n; ++j) {
            const double cosine = dot(lights[size_t(i)].direction, lights[size_t(j)].direction);
            kernel(i, j) = (1 - prior.single_share) * std::exp((cosine - 1) / (prior.length_rad * prior.length_rad));
        }
    kernel.diagonal().array() += prior.single_share;
    return kernel;
}

FillModel fill_model(const Basis& basis) {
    FillModel model;
    model.inverse.resize(basis.images(), basis.rows);
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image) model.inverse(image, row) = basis.inverse(row, image);
    RowResidual residual = row_residual(basis);
    model.residual = std::move(residual.projector);
    model.redundancy = residual.redundancy;
    model.spread = model.inverse.transpose() * model.inverse;
    return model;
}

void add_smooth_prior(FillModel& model, const std::vector<LightPosition>& lights, const SmoothPrior& prior) {
    const Eigen::LLT<Eigen::MatrixXd> kernel(smooth_kernel(lights, prior));
    model.precision = kernel.solve(Eigen::MatrixXd::Identity(model.images(), model.images()));
    model.roughness = model.inverse.transpose() * model.precision * model.inverse;
}

}  // namespace ols
