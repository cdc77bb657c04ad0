// SPDX-License-Identifier: MIT
// Real spherical harmonics as grey patterns of lamps (Wenger section 10 wishes for them).
#pragma once

#include <string>
#include <vector>

#include "stage/lamps.hpp"

namespace ols {

constexpr int harmonics_order_max = 10;  // 121 functions for 156 lamps

// The real, orthonormal spherical harmonic Y of degree l and order m, -l <= m <= l, in a direction (a unit vector). The polar
// axis is +y, up; the azimuth runs from +z, the camera, towards +x. For m > 0 it goes with cos(m azimuth), for m < 0 with
// sin(|m| azimuth); the integral of Y^2 over the sphere is 1. No Condon-Shortley sign: Y(1, 0) goes with y, Y(1, 1) with z,
// Y(1, -1) with x.
double real_harmonic(int l, int m, const Vec3& direction);

// Light cannot be negative. Split: the positive part of a function and the negative part, turned positive, in a slot each.
// Offset: (1 + Y / scale) / 2, in one slot.
enum class HarmonicSign { split, offset };

// A pattern of one function: its lamps' levels from 0 to `level_max`, rounded.
struct HarmonicPattern {
    std::string name;  // "Y(2,-1)+", "Y(2,-1)-", or without sign where it is offset
    double scale =
        1;  // the largest |Y| at a lamp. Split: Y = scale (plus - minus) / level_max; offset: scale (2 level / level_max - 1)
    std::vector<uint8_t> levels;
};

// All functions up to degree `order`, in the order l, then m; parts that light no lamp are left out (Y(0,0) has no negative).
std::vector<HarmonicPattern> harmonic_patterns(const std::vector<LightPosition>& lamps, int order, HarmonicSign sign,
                                               int level_max);

}  // namespace ols
