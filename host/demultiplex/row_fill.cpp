// SPDX-License-Identifier: MIT
// One Cholesky factorisation a set of masked rows.
#include "demultiplex/row_fill.hpp"

#include <Eigen/Cholesky>
#include <cassert>
#include <cmath>

#include "stage/row_losses.hpp"

namespace ols {

namespace {

// How much more the residual counts than the prior in their joint form. What the rows say of a masked one is thus weighed
// against the prior with an error of 1e-7, and double precision still has nine digits for the solution.
constexpr double residual_weight = 1e7;

Eigen::MatrixXd part(const Eigen::MatrixXd& whole, const std::vector<int>& rows, const std::vector<int>& columns) {
    return whole(rows, columns);
}

std::vector<int> others(int rows, const std::vector<int>& masked) {
    std::vector<int> rest;
    size_t next = 0;
    for (int row = 0; row < rows; ++row)
        if (next < masked.size() && masked[next] == row)
            ++next;
        else
            rest.push_back(row);
    return rest;
}

bool is_solvable(const FillModel& model, const std::vector<int>& masked) {
    if (int(masked.size()) > model.redundancy) return false;
    const Eigen::LDLT<Eigen::MatrixXd> factor(part(model.residual, masked, masked));
    return factor.vectorD().minCoeff() > pivot_least;
}

// The form that the masked values make least, scaled so that roughness is about 1.
Eigen::MatrixXd estimate_form(const FillModel& model, const std::vector<int>& masked, const std::vector<int>& columns) {
    const double scale = double(model.rows()) / model.roughness.trace();
    Eigen::MatrixXd form = scale * part(model.roughness, masked, columns);
    if (model.redundancy > 0) form += residual_weight * part(model.residual, masked, columns);
    return form;
}

// Mean and worst over images of |row of W E|^2 over |row of W|^2, E the filling of the rest to all rows.
void measure_noise(const FillModel& model, const std::vector<int>& rest, const Eigen::MatrixXd& weights,
                   RowFill& fill) {
    Eigen::MatrixXd filled = model.inverse(Eigen::all, rest);
    filled.noalias() += model.inverse(Eigen::all, fill.masked) * weights;
    const Eigen::ArrayXd variance = filled.rowwise().squaredNorm(), whole = model.inverse.rowwise().squaredNorm();
    fill.noise_gain = variance.sum() / whole.sum();
    fill.worst_noise_gain = (variance / whole).maxCoeff();
}

}  // namespace

Eigen::VectorXd power_function(const FillModel& model, const std::vector<int>& masked) {
    if (is_solvable(model, masked)) return Eigen::VectorXd::Zero(model.images());
    const Eigen::LLT<Eigen::MatrixXd> factor(estimate_form(model, masked, masked));
    const double scale = double(model.rows()) / model.roughness.trace();
    // Covariance W_M (form / scale)^-1 W_M': its directions that the rows determine vanish with 1 / residual_weight.
    const Eigen::MatrixXd half = factor.matrixL().solve(model.inverse(Eigen::all, masked).transpose());
    return (scale * half.colwise().squaredNorm().transpose()).cwiseSqrt();
}

RowFill row_fill(const FillModel& model, const std::vector<int>& masked, Estimate estimate) {
    assert(!masked.empty());
    RowFill fill;
    fill.masked = masked;
    const std::vector<int> rest = others(model.rows(), masked);
    const bool solvable = is_solvable(model, masked);
    fill.kind = solvable ? FillKind::solved : FillKind::estimated;
    if (!solvable && (!has_prior(estimate) || rest.empty())) {
        fill.kind = FillKind::unsolved;
        fill.noise_gain = fill.worst_noise_gain = 0;
        return fill;
    }
    Eigen::MatrixXd weights;
    if (solvable) {
        weights = -part(model.residual, masked, masked).ldlt().solve(part(model.residual, masked, rest));
    } else {
        const Eigen::LLT<Eigen::MatrixXd> factor(estimate_form(model, masked, masked));
        weights = -factor.solve(estimate_form(model, masked, rest));
        const Eigen::VectorXd power = power_function(model, masked);
        fill.power = std::sqrt(power.squaredNorm() / double(power.size()));
        fill.worst_power = power.maxCoeff();
    }
    measure_noise(model, rest, weights, fill);
    fill.weights.assign(masked.size() * size_t(model.rows()), 0);
    for (size_t k = 0; k < masked.size(); ++k) {
        fill.offset_share.push_back(float(1 - weights.row(Eigen::Index(k)).sum()));
        for (size_t j = 0; j < rest.size(); ++j)
            fill.weights[k * size_t(model.rows()) + size_t(rest[j])] = float(weights(Eigen::Index(k), Eigen::Index(j)));
    }
    return fill;
}

}  // namespace ols
