// SPDX-License-Identifier: MIT
// Polygons of any shape to triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stage/lamps.hpp"

namespace ols {

enum class PolygonShape {
    simple,          // cut into triangles
    without_area,    // all corners on a line: nothing to cut
    crosses_itself,  // its edges cross: what is inside of it is not known
    too_large,       // more corners than polygon_corners_max
};

constexpr size_t polygon_corners_max = 4096;  // cutting takes the square of it: a tenth of a second

// Appends the triangles of a polygon, corners counted from 0, turning as the polygon does. Convex ones become a fan of the first
// corner, others are cut ear by ear (Meisters 1975), the roundest ear first, seen along the polygon's mean normal (Newell's): corners
// in line, repeated ones, holes that an edge walked twice joins to the outline, and polygons that are not quite plane come out
// right. Nothing is appended but for simple polygons.
PolygonShape triangulate(std::span<const Vec3> polygon, std::vector<std::array<uint32_t, 3>>& triangles);

}  // namespace ols
