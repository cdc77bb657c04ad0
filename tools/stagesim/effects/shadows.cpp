// SPDX-License-Identifier: MIT
// One occlusion ray for every point that the lamp could light.
#include "shadows.hpp"

namespace ols {

std::string Shadows::caller(const Setup& setup) const {
    const auto& objects = setup.scene.objects;
    for (const Object& object : objects)
        if (!object.is_convex) return "scene: '" + object.name + "' can hide parts of itself";
    if (objects.size() > 1) return "scene: '" + objects[0].name + "' and '" + objects[1].name + "' can hide each other";
    return "";
}

uint32_t Shadows::apply(LightPacket& packet) const {
    const VisiblePoints& points = packet.points;
    RayPacket rays;
    uint32_t cast = 0;
    for (int i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i;
        rays.active[i] = packet.irradiance[i] > 0 && points.weight[p] > 0 ? -1 : 0;
        cast += rays.active[i] != 0;
        for (int axis = 0; axis < 3; ++axis) {
            rays.origin[axis][i] = points.position[axis][p] + shadow_offset_m * points.normal[axis][p];
            rays.direction[axis][i] = packet.to_lamp[axis][i];
        }
        rays.length[i] = packet.distance_m[i];
    }
    if (cast == 0) return 0;
    std::array<bool, packet_size> clear;
    clear.fill(true);
    packet.geometry.occlude(rays, clear);
    for (int i = 0; i < packet_size; ++i)
        if (!clear[i]) packet.irradiance[i] = 0;
    return cast;
}

}  // namespace ols
