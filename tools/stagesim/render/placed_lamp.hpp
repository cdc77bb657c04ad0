// SPDX-License-Identifier: MIT
// The stage's lamps as light sources in the scene.
#pragma once

#include <vector>

#include "scene/scene.hpp"
#include "stage/stage.hpp"

namespace ols {

// A point source whose irradiance at its aim, on a surface facing it, is the unit of light. Sphere lamps aim at the
// stage centre, matte lamps at the middle of the board.
struct PlacedLamp {
    Float3 position_m;
    Float3 direction;  // unit, from the aim to the lamp
    Float3 aim_m;
    float reach_m = 1;  // from the aim to the lamp
    float beam_exponent = 0;
    bool matte = false;
};

// Lamps in the stage's order: the sphere's, then the matte board's.
std::vector<PlacedLamp> place_lamps(const StageConfig& stage, const Scene& scene);

}  // namespace ols
