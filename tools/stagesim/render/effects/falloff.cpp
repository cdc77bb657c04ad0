// SPDX-License-Identifier: MIT
// E = cos (reach / d)^2, in units of the lamp's irradiance at its aim.
#include "render/effects/falloff.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

std::string Falloff::caller(const Setup& setup) const {
    if (setup.stage.lamp_count() == 0) return "";
    return fmt::format("stage: {} lamps stand {:g} m from the centre", setup.stage.lamp_count(), setup.stage.radius_m);
}

uint32_t Falloff::apply_packet(LightPacket& packet) const {
    const VisiblePoints& points = packet.points;
    const PlacedLamp& lamp = packet.lamp;
    for (int i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i;
        const float x = lamp.position_m.x - points.position[0][p], y = lamp.position_m.y - points.position[1][p],
                    z = lamp.position_m.z - points.position[2][p];
        const float squared = x * x + y * y + z * z, distance = std::sqrt(squared), inverse = 1 / distance;
        packet.to_lamp[0][i] = x * inverse;
        packet.to_lamp[1][i] = y * inverse;
        packet.to_lamp[2][i] = z * inverse;
        packet.distance_m[i] = distance;
        const float cosine = (x * points.normal[0][p] + y * points.normal[1][p] + z * points.normal[2][p]) * inverse;
        packet.irradiance[i] = packet.receives[i] * std::max(0.0f, cosine) * lamp.reach_m * lamp.reach_m / squared;
    }
    return packet_size;
}

}  // namespace ols
