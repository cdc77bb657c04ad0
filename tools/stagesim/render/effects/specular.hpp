// SPDX-License-Identifier: MIT
// The mirror-like part of reflection: a GGX microfacet lobe on top of the diffuse part.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Specular : public PacketEffect {
  public:
    const char* name() const override { return "specular"; }
    const char* evaluation() const override { return "point and lamp"; }
    std::string caller(const Setup& setup) const override;
    Stage stage() const override { return Stage::reflect; }
    uint32_t apply_packet(LightPacket& packet) const override;
};

// The lobe D V F for cosines of the half vector, light and view to the normal and of the half vector to the view;
// alpha is the roughness squared. In 1/sr; V holds the 1 / (4 nl nv).
float ggx(float n_h, float n_l, float n_v, float h_v, float alpha, float f0);

}  // namespace ols
