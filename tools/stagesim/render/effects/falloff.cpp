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
    const Lanes3 position = lanes_of(packet.points.position, packet.first),
                 normal = lanes_of(packet.points.normal, packet.first);
    const Lanes receives = packet.receives;
    const Float3 at = packet.lamp.position_m;
    const float reach_m = packet.lamp.reach_m;
    Lanes3 to_lamp;
    Lanes distance_m, irradiance;
    for (int i = 0; i < packet_size; ++i) {
        const float x = at.x - position[0][i], y = at.y - position[1][i], z = at.z - position[2][i];
        const float squared = x * x + y * y + z * z, distance = std::sqrt(squared), inverse = 1 / distance;
        to_lamp[0][i] = x * inverse;
        to_lamp[1][i] = y * inverse;
        to_lamp[2][i] = z * inverse;
        distance_m[i] = distance;
        const float cosine = (x * normal[0][i] + y * normal[1][i] + z * normal[2][i]) * inverse;
        irradiance[i] = receives[i] * std::max(0.0f, cosine) * reach_m * reach_m / squared;
    }
    packet.to_lamp = to_lamp, packet.distance_m = distance_m, packet.irradiance = irradiance;
    return packet_size;
}

}  // namespace ols
