// SPDX-License-Identifier: MIT
// A lamp is brightest along its axis, which points at its aim, and falls off as cos^n of the angle from it.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Beam : public PacketEffect {
  public:
    const char* name() const override { return "beam"; }
    const char* evaluation() const override { return "point and lamp"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::arrive; }
    uint32_t apply_packet(LightPacket& packet) const override;
};

}  // namespace ols
