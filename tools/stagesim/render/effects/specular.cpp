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
    const VisiblePoints& points = packet.points;
    uint32_t evaluations = 0;
    for (int i = 0; i < packet_size; ++i) {
        const uint32_t p = packet.first + i;
        if (packet.irradiance[i] <= 0 || points.f0[p] <= 0) continue;
        const Float3 n{points.normal[0][p], points.normal[1][p], points.normal[2][p]};
        const Float3 v{points.view[0][p], points.view[1][p], points.view[2][p]};
        const Float3 l{packet.to_lamp[0][i], packet.to_lamp[1][i], packet.to_lamp[2][i]};
        const Float3 h = normalized(l + v);
        // Interpolated normals may turn away from the camera at the silhouette: keep them just visible.
        const float n_v = std::max(dot(n, v), 1e-3f), n_l = std::max(dot(n, l), 1e-3f);
        const float n_h = std::clamp(dot(n, h), 0.0f, 1.0f), h_v = std::clamp(dot(h, v), 0.0f, 1.0f);
        const float alpha = points.roughness[p] * points.roughness[p];
        const float lobe =
            std::numbers::pi_v<float> * ggx(n_h, n_l, n_v, h_v, alpha, points.f0[p]) * packet.irradiance[i];
        for (auto& channel : packet.reflected) channel[i] += lobe;
        ++evaluations;
    }
    return evaluations;
}

}  // namespace ols
