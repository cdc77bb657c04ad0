// SPDX-License-Identifier: MIT
// GGX (Walter et al. 2007, eq. 33), height-correlated Smith visibility (Heitz 2014, eq. 99), Schlick's Fresnel (1994).
// The diffuse part is not dimmed by what the lobe takes, which is 3 to 5 % for skin.
#include "render/effects/specular.hpp"

#include <algorithm>
#include <numbers>

namespace ols {

std::string Specular::caller(const Setup& setup) const {
    for (const Object& object : setup.scene.objects)
        for (const uint32_t m : object.material_of_group)
            if (const Material& material = setup.scene.materials[m]; material.f0 > 0)
                return "material: '" + material.name + "' of '" + object.name + "' has f0 > 0";
    return "";
}

float ggx(float n_h, float n_l, float n_v, float h_v, float alpha, float f0) {
    const float a2 = alpha * alpha;
    const float d = n_h * n_h * (a2 - 1) + 1;
    const float distribution = a2 / (std::numbers::pi_v<float> * d * d);
    const float visibility =
        0.5f / (n_l * std::sqrt(n_v * n_v * (1 - a2) + a2) + n_v * std::sqrt(n_l * n_l * (1 - a2) + a2));
    const float m = 1 - h_v, m2 = m * m;
    return distribution * visibility * (f0 + (1 - f0) * m2 * m2 * m);
}

uint32_t Specular::apply_packet(LightPacket& packet) const {
    if (!packet.is_lit()) return 0;
    const Lanes3 normal = lanes_of(packet.points.normal, packet.first),
                 view = lanes_of(packet.points.view, packet.first), to_lamp = packet.to_lamp;
    const Lanes roughness = Lanes::of(packet.points.roughness, packet.first),
                f0 = Lanes::of(packet.points.f0, packet.first), irradiance = packet.irradiance;
    Lanes lobe;
    // Of unlit points too, whose lobe may be anything: they are left out below.
    for (int i = 0; i < packet_size; ++i) {
        const Float3 n{normal[0][i], normal[1][i], normal[2][i]};
        const Float3 v{view[0][i], view[1][i], view[2][i]};
        const Float3 l{to_lamp[0][i], to_lamp[1][i], to_lamp[2][i]};
        const Float3 h = normalized(l + v);
        // Interpolated normals may turn away from the camera at the silhouette: keep them just visible.
        const float n_v = std::max(dot(n, v), 1e-3f), n_l = std::max(dot(n, l), 1e-3f);
        const float n_h = std::clamp(dot(n, h), 0.0f, 1.0f), h_v = std::clamp(dot(h, v), 0.0f, 1.0f);
        const float alpha = roughness[i] * roughness[i];
        lobe[i] = std::numbers::pi_v<float> * ggx(n_h, n_l, n_v, h_v, alpha, f0[i]) * irradiance[i];
    }
    uint32_t evaluations = 0;
    for (int i = 0; i < packet_size; ++i) {
        const bool counts = int(!(irradiance[i] <= 0)) & int(!(f0[i] <= 0));  // no branch: it is to be vectorised
        lobe[i] = counts ? lobe[i] : 0;
        evaluations += counts;
    }
    for (Lanes& channel : packet.reflected)
        for (int i = 0; i < packet_size; ++i) channel[i] += lobe[i];
    return evaluations;
}

}  // namespace ols
