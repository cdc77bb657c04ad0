// SPDX-License-Identifier: MIT
// Points that something hides from the lamp get no light. Lamps are points, so shadows are hard.
#pragma once

#include "effect.hpp"

namespace ols {

class Shadows : public LightEffect {
  public:
    const char* name() const override { return "shadows"; }
    const char* evaluation() const override { return "ray"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::arrive; }
    uint32_t apply(LightPacket& packet) const override;
};

// Rays start this far off the surface along its shading normal, so as not to meet it again; more than the sagitta of
// the finest facets (0.03 mm), less than any gap that should cast a shadow.
constexpr float shadow_offset_m = 1e-4f;

}  // namespace ols
