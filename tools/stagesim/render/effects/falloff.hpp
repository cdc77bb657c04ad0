// SPDX-License-Identifier: MIT
// Lamps at their real distance: light comes from a point and falls off with the square of the distance. Without it
// lamps are infinitely far and light every point of the stage from the same direction.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Falloff : public PacketEffect {
  public:
    const char* name() const override { return "falloff"; }
    const char* evaluation() const override { return "point and lamp"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::arrive; }
    uint32_t apply_packet(LightPacket& packet) const override;
};

}  // namespace ols
