// SPDX-License-Identifier: MIT
// The picture of a basis report.
#pragma once

#include <string>

#include "stage/basis_figures.hpp"
#include "stage/flicker.hpp"

namespace ols {

// Draws levels in the order of play, singular values, noise gain and SNR of the images, and how lamps strobe, as a PNG by
// gnuplot; `flicker` is that of the basis's light. Errors: gnuplot is not installed, or cannot write there.
Status plot_basis(const std::string& path, const Sequence& sequence, const BasisFigures& figures,
                  const Flicker& flicker);

}  // namespace ols
