// SPDX-License-Identifier: MIT
// Triangles of neighbouring lamps (Wenger 5.2).
#pragma once

#include <array>
#include <vector>

#include "stage/lamps.hpp"

namespace ols {

using Triangle = std::array<int, 3>;  // lamps, ascending

// All triples of lamps that are neighbours of each other: the faces of a subdivided icosahedron, 300 for the stage's 156
// lamps. Neighbours are closer than 1.3 times the distance at which every lamp has a nearest one, which divides the stage's
// edges (0.55 and 0.62 of the radius) from its diagonals (above 0.94). Directions are unit vectors.
std::vector<Triangle> all_triangles(const std::vector<Vec3>& lamps);

// Those that point north: the highest lamp stands farther above the middle one than that above the lowest. 155 of the
// stage's 300 (Wenger names 156); every other triangle points south.
std::vector<Triangle> north_triangles(const std::vector<Vec3>& lamps);

}  // namespace ols
