// SPDX-License-Identifier: MIT
// The manifest's account of a basis.
#include "develop/basis_record.hpp"

#include <fmt/ranges.h>

#include <span>

#include "stage/basis_inverse.hpp"

namespace ols {

nlohmann::json basis_record(const Basis& basis) {
    const MatrixFigures figures = matrix_figures(basis);
    auto levels = nlohmann::json::array();
    for (int row = 0; row < basis.rows; ++row)
        levels.push_back(fmt::format(
            "{}",
            fmt::join(std::span(basis.levels).subspan(size_t(row) * size_t(basis.lamps), size_t(basis.lamps)), ",")));
    return {{"name", basis.name},
            {"rows", basis.rows},
            {"lamps", basis.lamps},
            {"images", basis.images()},
            {"rank", figures.rank},
            {"condition", figures.condition},
            {"is_estimate", basis.is_estimate},
            {"level_max", basis.level_max},
            {"levels", levels}};
}

}  // namespace ols
