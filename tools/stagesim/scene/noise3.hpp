// SPDX-License-Identifier: MIT
// Gradient noise of space for procedural textures: smooth, repeatable, zero mean.
#pragma once

#include <cstdint>

#include "scene/vector.hpp"

namespace ols {

// Perlin's improved noise (2002) with hashed lattice gradients, one feature a unit, values in about [-1, 1].
float noise3(Float3 p, uint32_t seed);

// Octaves of noise3, each of half the size and `gain` times the height of the one before, scaled to about [-1, 1].
float fractal_noise3(Float3 p, int octaves, float gain, uint32_t seed);

// Distance to the nearest of points scattered one a unit cell, 0 at a point (Worley 1996), and that point's own random
// number, 0 to 1. Points farther than `within` are not looked for: the distance is then anything above it.
struct Speckle {
    float distance, random;
};
Speckle speckle3(Float3 p, uint32_t seed, float within);

}  // namespace ols
