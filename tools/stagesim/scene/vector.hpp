// SPDX-License-Identifier: MIT
// Single-precision vectors for rendering; positions are metres in stage coordinates (x right, y up, z to the camera).
#pragma once

#include <cmath>

#include "stage/lamps.hpp"

namespace ols {

struct Float3 {
    float x = 0, y = 0, z = 0;

    friend Float3 operator+(Float3 a, Float3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Float3 operator-(Float3 a, Float3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Float3 operator*(Float3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
    friend Float3 operator*(Float3 a, Float3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
    bool operator==(const Float3&) const = default;
};

inline float dot(Float3 a, Float3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

inline Float3 cross(Float3 a, Float3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline float length(Float3 v) {
    return std::sqrt(dot(v, v));
}

// The zero vector stays zero.
inline Float3 normalized(Float3 v) {
    const float l = length(v);
    return l > 0 ? v * (1 / l) : v;
}

inline Float3 mix(Float3 a, Float3 b, float t) {
    return a * (1 - t) + b * t;
}

inline Float3 to_float3(Vec3 v) {
    return {float(v.x), float(v.y), float(v.z)};
}

}  // namespace ols
