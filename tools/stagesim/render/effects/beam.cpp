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
    if (!packet.is_lit()) return 0;
    const Lanes3 position = lanes_of(packet.points.position, packet.first);
    const Float3 at = packet.lamp.position_m, axis = packet.lamp.direction;
    Lanes cosine;
    for (int i = 0; i < packet_size; ++i) {
        const Float3 from_lamp = Float3{position[0][i], position[1][i], position[2][i]} - at;
        cosine[i] = -dot(from_lamp, axis) / length(from_lamp);
    }
    uint32_t evaluations = 0;
    for (int i = 0; i < packet_size; ++i) {
        if (packet.irradiance[i] <= 0) continue;
        packet.irradiance[i] *= std::pow(std::max(0.0f, cosine[i]), packet.lamp.beam_exponent);
        ++evaluations;
    }
    return evaluations;
}

}  // namespace ols
