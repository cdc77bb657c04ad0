// SPDX-License-Identifier: MIT
// Interpolation of keyframes: linear in translation, slerp (Shoemake 1985) in rotation.
#include "scene/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ols {

namespace {

Quaternion slerp(Quaternion a, Quaternion b, double t) {
    double cosine = 0;
    for (int i = 0; i < 4; ++i) cosine += a[i] * b[i];
    // q and -q are the same rotation: take the nearer one.
    if (cosine < 0) {
        for (double& v : b) v = -v;
        cosine = -cosine;
    }
    // Below this angle sin(angle) loses its digits and the chord is the arc.
    const double angle = std::acos(std::min(1.0, cosine));
    const bool tiny = angle < 1e-6;
    const double wa = tiny ? 1 - t : std::sin((1 - t) * angle) / std::sin(angle);
    const double wb = tiny ? t : std::sin(t * angle) / std::sin(angle);
    Quaternion q;
    double norm = 0;
    for (int i = 0; i < 4; ++i) norm += (q[i] = wa * a[i] + wb * b[i]) * q[i];
    for (double& v : q) v /= std::sqrt(norm);
    return q;
}

bool same(Vec3 a, Vec3 b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

}  // namespace

Quaternion rotation_about(Vec3 axis, double angle_deg) {
    const Vec3 unit = normalized(axis);
    const double half = angle_deg * std::numbers::pi / 360, s = std::sin(half);
    return {std::cos(half), unit.x * s, unit.y * s, unit.z * s};
}

Vec3 Pose::turn(Vec3 v) const {
    // v + 2 w (u x v) + 2 u x (u x v)
    const Vec3 u{rotation[1], rotation[2], rotation[3]};
    const Vec3 t = cross(u, v) * 2;
    return v + t * rotation[0] + cross(u, t);
}

Float3 Pose::turn(Float3 direction) const {
    return to_float3(turn(Vec3{direction.x, direction.y, direction.z}));
}

bool Pose::operator==(const Pose& other) const {
    return rotation == other.rotation && same(translation_m, other.translation_m);
}

Pose pose_at(const std::vector<Keyframe>& keyframes, double time_us) {
    if (keyframes.empty()) return {};
    const auto after = std::upper_bound(keyframes.begin(), keyframes.end(), time_us,
                                        [](double t, const Keyframe& k) { return t < k.time_us; });
    if (after == keyframes.begin()) return {after->rotation, after->translation_m};
    const Keyframe& a = *(after - 1);
    if (after == keyframes.end()) return {a.rotation, a.translation_m};
    const double t = (time_us - a.time_us) / (after->time_us - a.time_us);
    return {slerp(a.rotation, after->rotation, t), a.translation_m * (1 - t) + after->translation_m * t};
}

bool moves(const std::vector<Keyframe>& keyframes) {
    return std::any_of(keyframes.begin(), keyframes.end(), [&](const Keyframe& k) {
        return k.rotation != keyframes[0].rotation || !same(k.translation_m, keyframes[0].translation_m);
    });
}

}  // namespace ols
