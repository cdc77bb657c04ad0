// SPDX-License-Identifier: MIT
// Rigid motion over time: keyframes of rotation and translation about the stage centre.
#pragma once

#include <array>
#include <vector>

#include "scene/vector.hpp"

namespace ols {

// Unit quaternion, (w, x, y, z).
using Quaternion = std::array<double, 4>;

Quaternion rotation_about(Vec3 axis, double angle_deg);

struct Keyframe {
    double time_us = 0;
    Vec3 translation_m;
    Quaternion rotation = {1, 0, 0, 0};
};

struct Pose {
    Quaternion rotation = {1, 0, 0, 0};
    Vec3 translation_m;

    Float3 point(Float3 p) const { return turn(p) + to_float3(translation_m); }
    Float3 turn(Float3 direction) const;
    Vec3 turn(Vec3 direction) const;
    bool operator==(const Pose&) const;
};

// The pose at a time: translation linear and rotation by spherical linear interpolation (the shorter way round)
// between neighbouring keyframes, held before the first and after the last. Keyframes ascend in time; none is the
// identity.
Pose pose_at(const std::vector<Keyframe>& keyframes, double time_us);

// Whether any two keyframes differ.
bool moves(const std::vector<Keyframe>& keyframes);

}  // namespace ols
