// SPDX-License-Identifier: MIT
// How bright each light was, so that its picture can be brought to a light of 1.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

using Intensity = std::array<double, 3>;  // R G B

// Reads a text file with a line for each light: one number or R G B, in the order of `lights` (DiLiGenT's light_intensities.txt), or the
// light's name (or its last part) before them, in any order. Errors name file and line: no number, not above 0, another count, a name
// that is none of the lights.
Result<std::vector<Intensity>> read_light_intensities(const std::string& path,
                                                      const std::vector<LightPosition>& lights);

}  // namespace ols
