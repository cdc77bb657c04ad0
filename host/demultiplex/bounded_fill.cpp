// SPDX-License-Identifier: MIT
// Newton's method on the set of bounds that are violated.
#include "demultiplex/bounded_fill.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace ols {

namespace {

constexpr int steps_max = 50;     // some 10 are usual
constexpr int halvings_max = 20;  // of a step that does not descend

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
    const auto value = [&](const Eigen::VectorXd& y, const Eigen::VectorXd& x) {
        return y.dot(free_form * y - 2 * pull) + image_weight * x.cwiseMin(0).squaredNorm() +
               row_weight * (least - y.array()).max(0).square().sum();
    };
    double reached = value(filled, images);
    for (int step = 0; step < steps_max; ++step) {
        const ActiveSet below = filled.array() < least, dark = images.array() < 0;
        const Eigen::MatrixXd weighted = (image_weight * dark.cast<double>()).matrix().asDiagonal() * images_of;
        Eigen::MatrixXd newton = free_form;
        newton.noalias() += images_of.transpose() * weighted;
        newton.diagonal() += row_weight * below.cast<double>().matrix();
        const Eigen::VectorXd target =
            pull - weighted.transpose() * images_of_rest + below.select(row_weight * least, 0.0).matrix();
        Eigen::VectorXd move = newton.llt().solve(target) - filled;
        const double before = reached;
        for (int halving = 0; halving < halvings_max; ++halving, move /= 2) {
            const Eigen::VectorXd moved = filled + move, moved_images = images_of_rest + images_of * moved;
            const double there = value(moved, moved_images);
            if (there >= reached) continue;
            filled = moved, images = moved_images, reached = there;
            break;
        }
        if (!(reached < before - 1e-12 * std::abs(before))) break;
    }
    rows(masked) = filled;
}

}  // namespace ols
