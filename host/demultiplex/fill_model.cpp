// SPDX-License-Identifier: MIT
// The projector on the residuals by a rank-revealing QR, and the prior's form by Cholesky, both Eigen's.
#include "demultiplex/fill_model.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
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

namespace {

// Far above rounding, far below what the least bit of a level makes (stage/basis_inverse.hpp has the same).
constexpr double rank_tolerance = 1e-9;

Eigen::MatrixXd light_of_images(const Basis& basis) {
    Eigen::MatrixXd light(basis.rows, basis.images());
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image)
            light(row, image) = basis.light(row, basis.image_lamps[size_t(image)].front());
    return light;
}

}  // namespace

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

bool is_one_image_a_row(const Basis& basis) {
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image)
            if ((basis.inverse(row, image) != 0) != (row == image)) return false;
    return true;
}

FillModel fill_model(const Basis& basis) {
    FillModel model;
    model.inverse.resize(basis.images(), basis.rows);
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image) model.inverse(image, row) = basis.inverse(row, image);
    model.residual = Eigen::MatrixXd::Zero(basis.rows, basis.rows);
    if (!is_one_image_a_row(basis)) {
        Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
        qr.setThreshold(rank_tolerance);
        qr.compute(light_of_images(basis));
        model.redundancy = basis.rows - int(qr.rank());
        const Eigen::MatrixXd unexplained =
            Eigen::MatrixXd(qr.householderQ()).rightCols(model.redundancy);  // orthonormal, the left null space of P
        model.residual = unexplained * unexplained.transpose();
    }
    model.spread = model.inverse.transpose() * model.inverse;
    return model;
}

void add_smooth_prior(FillModel& model, const std::vector<LightPosition>& lights, const SmoothPrior& prior) {
    const Eigen::LLT<Eigen::MatrixXd> kernel(smooth_kernel(lights, prior));
    model.precision = kernel.solve(Eigen::MatrixXd::Identity(model.images(), model.images()));
    model.roughness = model.inverse.transpose() * model.precision * model.inverse;
}

}  // namespace ols
