// SPDX-License-Identifier: MIT
// cos^n between the lamp's axis and the way to the point.
#include "render/effects/beam.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

std::string Beam::caller(const Setup& setup) const {
    if (setup.stage.lamp_beam_exponent == 0 || setup.stage.lamp_count() == 0) return "";
    return fmt::format("stage: the lamps' beam falls off as cos^{:g}", setup.stage.lamp_beam_exponent);
}

uint32_t Beam::apply_packet(LightPacket& packet) const {
    const VisiblePoints& points = packet.points;
    const PlacedLamp& lamp = packet.lamp;
    uint32_t evaluations = 0;
    for (int i = 0; i < packet_size; ++i) {
        if (packet.irradiance[i] <= 0) continue;
        const uint32_t p = packet.first + i;
        const Float3 from_lamp =
            Float3{points.position[0][p], points.position[1][p], points.position[2][p]} - lamp.position_m;
        const float cosine = -dot(from_lamp, lamp.direction) / length(from_lamp);
        packet.irradiance[i] *= std::pow(std::max(0.0f, cosine), lamp.beam_exponent);
        ++evaluations;
    }
    return evaluations;
}

}  // namespace ols
