// SPDX-License-Identifier: MIT
// Basis files: levels as text that spreadsheets and numpy.loadtxt read.
//
//   # level_max = 255
//   0,255,128,...      a row a line, a level a lamp, separated by commas, semicolons, tabs or blanks
//
// Lines that begin with # are comments, of which `# level_max = N` is understood (N is 1 or 2^planes - 1, up to 255).
// Without it, level_max is 1 if no level is higher, else 255.
#pragma once

#include <string>

#include "result.hpp"
#include "stage/basis.hpp"

namespace ols {

// Reads the levels and inverts them by least squares (with_least_squares). The basis is named for the file, without folder
// and ending. Errors name file and line: a word that is no level, an empty cell, a row of another length than `lamps`, more
// rows than a board plays slots.
Result<Basis> read_basis(const std::string& path, int lamps);

// The levels of any basis as such text; `comment`, if any, becomes comment lines.
std::string basis_text(const Basis& basis, const std::string& comment = "");

// Writes it. Never leaves a half-written file.
Status write_basis(const std::string& path, const Basis& basis, const std::string& comment = "");

}  // namespace ols
