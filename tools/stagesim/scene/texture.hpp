// SPDX-License-Identifier: MIT
// What a surface reflects at a point: plain materials, and procedural skin, eyes and hair.
#pragma once

#include "scene/scene.hpp"

namespace ols {

struct Look {
    Float3 albedo;
    float roughness = 1;
    float f0 = 0;
    Float3 slope;  // of the fine relief of skin, metres a metre, in the object's rest pose
};

// `position` in the object's rest pose (metres): textures move with the object. `mask` is the mesh's vertex colour; for skin
// (lips, hair, flush), for eyes (angle from the axis over pi, -, -), each 0 to 1.
Look look_of(const Material& material, Float3 position, Float3 mask);

// The shading normal of a relief on a surface of unit normal `normal`, both in the rest pose: only what of the slope lies in the
// surface tilts it.
Float3 relieved(Float3 normal, Float3 slope);

}  // namespace ols
