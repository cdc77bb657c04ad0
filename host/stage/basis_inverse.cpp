// SPDX-License-Identifier: MIT
// Pseudo-inverses by Eigen's singular value decomposition.
#include "stage/basis_inverse.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

namespace ols {

namespace {

using Svd = Eigen::BDCSVD<Eigen::MatrixXd>;

Eigen::MatrixXd light_of(const Basis& basis, const std::vector<int>& lamps) {
    Eigen::MatrixXd light(basis.rows, Eigen::Index(lamps.size()));
    for (int r = 0; r < basis.rows; ++r)
        for (size_t i = 0; i < lamps.size(); ++i) light(r, Eigen::Index(i)) = basis.light(r, lamps[i]);
    return light;
}

std::vector<int> lit_lamps(const Basis& basis) {
    std::vector<int> lamps;
    for (int lamp = 0; lamp < basis.lamps; ++lamp)
        for (int r = 0; r < basis.rows; ++r)
            if (basis.lit(r, lamp)) {
                lamps.push_back(lamp);
                break;
            }
    return lamps;
}

MatrixFigures figures_of(const Eigen::VectorXd& values) {
    MatrixFigures figures;
    figures.singular_values.assign(values.begin(), values.end());
    for (const double value : values) figures.rank += value > rank_tolerance * values(0);
    if (figures.rank > 0) figures.condition = values(0) / values(figures.rank - 1);
    return figures;
}

}  // namespace

MatrixFigures matrix_figures(const Basis& basis) {
    return figures_of(Svd(light_of(basis, lit_lamps(basis))).singularValues());
}

Result<Basis> with_least_squares(Basis basis) {
    const auto lamps = lit_lamps(basis);
    if (lamps.empty()) return fail(fmt::format("basis {} lights no lamp", basis.name));
    const Svd svd(light_of(basis, lamps), Eigen::ComputeThinU | Eigen::ComputeThinV);
    const MatrixFigures figures = figures_of(svd.singularValues());
    if (figures.condition > condition_max)
        return fail(fmt::format(
            "basis {} is near-singular: its condition number is {:.3g}, and beyond {:.0e} noise and the lamps' own "
            "tolerance drown the result; remove rows that nearly repeat others, or add rows",
            basis.name, figures.condition, condition_max));
    const auto rank = Eigen::Index(figures.rank);
    const Eigen::MatrixXd inverse = svd.matrixV().leftCols(rank) *
                                    svd.singularValues().head(rank).cwiseInverse().asDiagonal() *
                                    svd.matrixU().leftCols(rank).transpose();
    basis.is_estimate = figures.rank < int(lamps.size());
    for (const int lamp : lamps) basis.image_lamps.push_back({lamp});
    basis.matrix.resize(size_t(basis.rows) * lamps.size());
    for (int r = 0; r < basis.rows; ++r)
        for (size_t i = 0; i < lamps.size(); ++i)
            basis.matrix[size_t(r) * lamps.size() + i] = inverse(Eigen::Index(i), r);
    return basis;
}

}  // namespace ols
