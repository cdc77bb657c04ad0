// SPDX-License-Identifier: MIT
// The projector on the residuals by Eigen's complete orthogonal decomposition, and small sets of rows by Cholesky's.
#include "stage/row_losses.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include "stage/basis_inverse.hpp"

namespace ols {

namespace {

using Decomposition = Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>;

Decomposition decompose(const Basis& basis) {
    Eigen::MatrixXd light(basis.rows, basis.lamps);
    for (int row = 0; row < basis.rows; ++row)
        for (int lamp = 0; lamp < basis.lamps; ++lamp) light(row, lamp) = basis.light(row, lamp);
    Decomposition decomposition;
    decomposition.setThreshold(rank_tolerance);
    return decomposition.compute(light);
}

// The left null space of the levels, orthonormal.
Eigen::MatrixXd unexplained_by(const Decomposition& decomposition) {
    return Eigen::MatrixXd(decomposition.householderQ()).rightCols(decomposition.rows() - decomposition.rank());
}

RowResidual residual_of(const Decomposition& decomposition) {
    const Eigen::MatrixXd unexplained = unexplained_by(decomposition);
    return {unexplained * unexplained.transpose(), int(unexplained.cols())};
}

RowResidual no_residual(const Basis& basis) {
    return {Eigen::MatrixXd::Zero(basis.rows, basis.rows), 0};
}

}  // namespace

bool is_one_image_a_row(const Basis& basis) {
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image)
            if ((basis.inverse(row, image) != 0) != (row == image)) return false;
    return true;
}

RowResidual row_residual(const Basis& basis) {
    return is_one_image_a_row(basis) ? no_residual(basis) : residual_of(decompose(basis));
}

Eigen::MatrixXd parity_checks(const Basis& basis) {
    return unexplained_by(decompose(basis));
}

RowLosses::RowLosses(const Basis& basis) : residual_(no_residual(basis)) {
    if (is_one_image_a_row(basis)) return;
    const Decomposition decomposition = decompose(basis);
    residual_ = residual_of(decomposition);
    if (residual_.redundancy == 0) return;
    const Eigen::MatrixXd inverse = decomposition.pseudoInverse();
    spread_ = inverse.transpose() * inverse / inverse.squaredNorm();
}

double RowLosses::noise_gain(std::span<const int> rows) const {
    assert(rows.size() <= rows_max);
    if (rows.empty()) return 1;
    if (int(rows.size()) > redundancy()) return std::numeric_limits<double>::infinity();
    using Part = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, rows_max, rows_max>;  // no allocation
    const Part residual = residual_.projector(rows, rows), spread = spread_(rows, rows);
    const Eigen::LLT<Part> factor(residual);
    const Part lower = factor.matrixL();
    if (factor.info() != Eigen::Success || lower.diagonal().cwiseAbs2().minCoeff() < pivot_least)
        return std::numeric_limits<double>::infinity();
    return 1 + factor.solve(spread).trace();
}

std::vector<int> RowLosses::classes() const {
    std::vector<int> class_of(size_t(rows()), -1), first_rows;
    for (int row = 0; row < rows(); ++row) {
        if (!std::isfinite(noise_gain(std::array{row}))) continue;
        size_t c = 0;
        while (c < first_rows.size() && std::isfinite(noise_gain(std::array{first_rows[c], row}))) ++c;
        if (c == first_rows.size()) first_rows.push_back(row);
        class_of[size_t(row)] = int(c);
    }
    return class_of;
}

}  // namespace ols
