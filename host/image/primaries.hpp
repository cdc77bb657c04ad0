// SPDX-License-Identifier: MIT
// Linear light from other primaries to those of Rec. 709.
#pragma once

#include <array>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

struct Chromaticity {
    double x, y;  // CIE 1931
};

struct Primaries {
    Chromaticity red, green, blue, white;
};

inline constexpr Primaries rec709_primaries = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}};
inline constexpr Primaries rec2020_primaries = {{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}};
inline constexpr Primaries p3_d65_primaries = {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}};
// Adobe RGB (1998), section 4.3.1.
inline constexpr Primaries adobe_primaries = {{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, {0.3127, 0.3290}};
inline constexpr Chromaticity equal_energy_white = {1.0 / 3, 1.0 / 3};

// Within 1e-4 in every coordinate, which is what files round to.
bool are_same(const Primaries& a, const Primaries& b);
bool are_rec709(const Primaries& primaries);

// Converts the first three channels; white stays white (1, 1, 1), adapted by Bradford's cone responses (ICC.1:2022, annex E.3).
// An error if the primaries span no colours (no triangle, white outside it, not finite).
Status convert_to_rec709(Image& rgb, const Primaries& from);

// The same from CIE XYZ, of which the `white` of luminance 1 becomes (1, 1, 1).
Status convert_xyz_to_rec709(Image& xyz, Chromaticity white);

// The shares of R, G and B in luminance Y; they sum to 1. The same errors.
Result<std::array<double, 3>> luminance_weights(const Primaries& primaries);

}  // namespace ols
