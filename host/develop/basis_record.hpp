// SPDX-License-Identifier: MIT
// What an archive says of its basis.
#pragma once

#include <nlohmann/json.hpp>

#include "stage/basis.hpp"

namespace ols {

// For the manifest's extra.basis: name, rows, lamps, images, rank and condition number (by singular values), whether the
// images are an estimate, and the levels, each row as the line of a basis file (stage/basis_file.hpp).
nlohmann::json basis_record(const Basis& basis);

}  // namespace ols
