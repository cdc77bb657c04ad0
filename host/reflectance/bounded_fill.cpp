// SPDX-License-Identifier: MIT
// Newton's method on the set of bounds that are violated.
#include "reflectance/bounded_fill.hpp"

#include <Eigen/Cholesky>

namespace ols {

namespace {

constexpr int steps_max = 20;

using ActiveSet = Eigen::Array<bool, Eigen::Dynamic, 1>;

}  // namespace

void bound_fill(const FillModel& model, const std::vector<int>& masked, const FillBounds& bounds,
                Eigen::VectorXd& rows) {
    const double row_weight = 1 / (bounds.sigma_row * bounds.sigma_row);
    const double image_weight = row_weight * model.images() / model.spread.trace();
    const Eigen::Map<const Eigen::ArrayXd> least(bounds.least.data(), Eigen::Index(bounds.least.size()));
    const Eigen::MatrixXd images_of = model.inverse(Eigen::all, masked);
    Eigen::VectorXd rest = rows;
    rest(masked).setZero();
    const Eigen::VectorXd images_of_rest = model.inverse * rest;
    Eigen::VectorXd filled = rows(masked), images = model.inverse * rows;
    const double smooth_weight = model.images() / std::max(images.dot(model.precision * images), 1e-30);

    Eigen::MatrixXd form = smooth_weight * model.roughness(masked, Eigen::all);
    form += row_weight * model.residual(masked, Eigen::all);
    const Eigen::VectorXd pull = -form * rest;
    const Eigen::MatrixXd free_form = form(Eigen::all, masked);
    ActiveSet below, dark;
    for (int step = 0; step < steps_max; ++step) {
        const ActiveSet below_now = filled.array() < least, dark_now = images.array() < 0;
        if (step > 0 && (below_now == below).all() && (dark_now == dark).all()) break;
        below = below_now, dark = dark_now;
        const Eigen::VectorXd below_weight = row_weight * below.cast<double>();
        const Eigen::VectorXd dark_weight = image_weight * dark.cast<double>();
        const Eigen::MatrixXd weighted = dark_weight.asDiagonal() * images_of;
        Eigen::MatrixXd newton = free_form;
        newton.noalias() += images_of.transpose() * weighted;
        newton.diagonal() += below_weight;
        const Eigen::VectorXd target =
            pull - weighted.transpose() * images_of_rest + below.select(row_weight * least, 0.0).matrix();
        filled = newton.llt().solve(target);
        images = images_of_rest + images_of * filled;
    }
    rows(masked) = filled;
}

}  // namespace ols
