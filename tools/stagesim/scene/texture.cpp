// SPDX-License-Identifier: MIT
// Skin as layers of tint over the material's albedo (blotches of blood, freckles, pores, stubble, lips, hair), an eye of
// sclera, limbus, iris and pupil, and strands of hair. Sizes are those of an adult face, in metres; tints are linear albedo factors.
#include "scene/texture.hpp"

#include <algorithm>

#include "scene/noise3.hpp"

namespace ols {

namespace {

float smoothstep(float low, float high, float value) {
    const float t = std::clamp((value - low) / (high - low), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

// Fine relief in metres: creases of some 3 mm and pores of 1 mm, shallower where there is hair.
float relief(Float3 p) {
    return 0.8e-4f * fractal_noise3(p * 330, 3, 0.6f, 11) -
           0.45e-4f * smoothstep(0.45f, 0.0f, speckle3(p * 850, 12, 0.45f).distance);
}

Float3 slope_of_relief(Float3 p) {
    constexpr float step = 2e-4f;
    const float here = relief(p);
    return {(relief(p + Float3{step, 0, 0}) - here) / step, (relief(p + Float3{0, step, 0}) - here) / step,
            (relief(p + Float3{0, 0, step}) - here) / step};
}

Look skin(const Material& material, Float3 p, Float3 mask) {
    const float lips = mask.x, hair = mask.y, flush = mask.z;
    // Melanin and blood vary at several scales; redness follows the flush mask and its own blotches.
    const float tone = fractal_noise3(p * 38, 5, 0.55f, 1);
    const float blood = std::clamp(0.55f * flush + 0.38f * fractal_noise3(p * 70, 4, 0.6f, 2) + 0.08f, 0.0f, 1.0f);
    Float3 albedo = material.albedo * (1 + 0.20f * tone);
    albedo = albedo * mix({1, 1, 1}, {1.02f, 0.72f, 0.66f}, blood);

    // Freckles gather where the sun reaches: nose and cheeks, as the flush does.
    const Speckle freckle = speckle3(p * 300, 3, 0.32f);
    const float sunned = freckle.random > 0.93f - 0.45f * flush ? 0.3f + 0.6f * flush : 0;
    const float freckled = sunned * smoothstep(0.32f, 0.08f, freckle.distance) * (1 - lips);
    albedo = albedo * mix({1, 1, 1}, {0.74f, 0.60f, 0.50f}, freckled);
    albedo = albedo * (1 - 0.10f * smoothstep(0.4f, 0.0f, speckle3(p * 850, 12, 0.4f).distance));

    // Lips: darker and redder with fine vertical creases.
    const float crease = lips > 0 ? noise3({p.x * 900, p.y * 160, p.z * 300}, 5) : 0;
    albedo = mix(albedo, material.albedo * Float3{0.78f, 0.40f, 0.42f} * (1 + 0.12f * crease), 0.85f * lips);

    // Short hair: strands of about half a millimetre that let some skin through.
    const float strand = hair > 0 ? 0.5f + 0.5f * noise3({p.x * 1500, p.y * 700, p.z * 1000}, 6) : 0;
    const float cover = std::clamp(hair * (0.75f + 0.5f * strand), 0.0f, 1.0f);
    albedo = mix(albedo, {0.030f, 0.021f, 0.016f}, cover);

    Look look;
    look.albedo = albedo;
    const float oil = std::clamp(0.5f * flush + 0.4f * fractal_noise3(p * 25, 2, 0.5f, 7), -0.3f, 0.5f);
    look.roughness = std::clamp(material.roughness * (1 - 0.25f * oil - 0.30f * lips + 0.25f * hair), 0.05f, 1.0f);
    look.f0 = material.f0 * (1 - 0.5f * cover);
    look.slope = slope_of_relief(p) * (1 - 0.4f * lips);
    return look;
}

// Combed hair: locks of some 6 mm, strands of 1.5 mm and of half that, all along y and a little wavy.
Look hair(const Material& material, Float3 p) {
    const float wave = 0.003f * noise3(p * 35, 31);
    const auto across = [&](float per_m, uint32_t seed) {
        return noise3({(p.x + wave) * per_m, p.y * per_m * 0.04f, p.z * per_m}, seed);
    };
    const float shade = 1 + 0.35f * across(160, 32) + 0.75f * across(660, 33) + 0.45f * across(1300, 34);
    return {material.albedo * std::max(0.08f, shade), material.roughness, material.f0, {}};
}

// Angles from the eye's axis over pi; the head.py of assets puts the limbus where the cornea meets the globe, asin(1/2).
constexpr float limbus_angle = 1.0f / 6, pupil_angle = 0.055f;

Look eye(const Material& material, Float3 p, Float3 mask) {
    const float angle = mask.x;
    const float veins = std::max(0.0f, fractal_noise3(p * 700, 3, 0.6f, 21) - 0.15f);
    const Float3 sclera =
        Float3{0.62f, 0.57f, 0.53f} * mix({1, 1, 1}, {0.95f, 0.62f, 0.56f}, std::min(1.0f, 1.6f * veins));
    // Iris: fibres run outwards, lighter around the pupil, dark at the limbus.
    const float across = (angle - pupil_angle) / (limbus_angle - pupil_angle);
    const float fibre = noise3({p.x * 2200, p.y * 2200, p.z * 300}, 22);
    const Float3 iris = material.albedo * (1.15f - 0.55f * across) * (1 + 0.45f * fibre);
    Float3 albedo = mix(iris, sclera, smoothstep(limbus_angle - 0.006f, limbus_angle + 0.010f, angle));
    const float ring = 1 - smoothstep(0.0f, 0.016f, std::abs(angle - limbus_angle));
    albedo = albedo * (1 - 0.6f * ring);
    albedo = mix({0.004f, 0.004f, 0.004f}, albedo, smoothstep(pupil_angle - 0.006f, pupil_angle + 0.004f, angle));
    return {albedo, material.roughness, material.f0, {}};
}

}  // namespace

Look look_of(const Material& material, Float3 position, Float3 mask) {
    switch (material.type) {
        case MaterialType::skin: return skin(material, position, mask);
        case MaterialType::eye: return eye(material, position, mask);
        case MaterialType::hair: return hair(material, position);
        case MaterialType::diffuse: break;
    }
    return {material.albedo, material.roughness, material.f0, {}};
}

Float3 relieved(Float3 normal, Float3 slope) {
    if (slope == Float3{}) return normal;
    return normalized(normal - (slope - normal * dot(slope, normal)));
}

}  // namespace ols
