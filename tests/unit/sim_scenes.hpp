// SPDX-License-Identifier: MIT
// Small scenes and stages that the tests of the virtual stage share.
#pragma once

#include "scene/scene.hpp"
#include "stage/stage.hpp"

namespace ols {

inline Material matte(float albedo) {
    Material material;
    material.name = "matte";
    material.albedo = {albedo, albedo, albedo};
    return material;
}

inline void add_sphere(Scene& scene, Vec3 center_m, double radius_m, const Material& material) {
    scene.materials.push_back(material);
    Object object;
    object.name = "sphere";
    object.shape = Sphere{to_float3(center_m), float(radius_m)};
    object.material_of_group = {uint32_t(scene.materials.size() - 1)};
    object.is_convex = true;
    scene.objects.push_back(object);
}

inline void add_quad(Scene& scene, Vec3 center_m, Vec3 normal, Vec3 up, double size_m, const Material& material) {
    scene.materials.push_back(material);
    Object object;
    object.name = "quad";
    object.shape = make_quad(center_m, normal, up, size_m, size_m);
    object.material_of_group = {uint32_t(scene.materials.size() - 1)};
    object.is_convex = true;
    scene.objects.push_back(object);
}

// A stage of lamps in given directions at 1 m, without beam and matte lamps, and one small camera without vignetting.
inline StageConfig small_stage(const std::vector<Vec3>& lamps, int width = 64, int height = 48) {
    StageConfig stage;
    for (const Vec3 direction : lamps) stage.lamps.push_back({"lamp", normalized(direction)});
    stage.lamp_beam_exponent = 0;
    for (int i = 0; i < int(lamps.size()); ++i) stage.chain_bit_of_lamp.push_back(i);
    stage.chain_bits = 16;
    CameraConfig camera;
    camera.width = width, camera.height = height;
    camera.vignetting = 0;
    stage.cameras.push_back(camera);
    return stage;
}

// Where the ray of a pixel's middle goes, in double precision and by other means than the renderer: the camera stands
// at (0, 0, 1.6) and looks at the origin, as the default camera does.
inline Vec3 default_camera_ray(const CameraConfig& camera, int x, int y) {
    const double half = std::tan(camera.vertical_fov_deg / 2 * 3.14159265358979323846 / 180);
    return normalized(Vec3{((x + 0.5) / camera.width * 2 - 1) * half * camera.width / camera.height,
                           (1 - (y + 0.5) / camera.height * 2) * half, -1});
}

inline std::vector<Float3> one_lamp(size_t lamps, size_t lit, float weight = 1) {
    std::vector<Float3> weights(lamps);
    weights[lit] = {weight, weight, weight};
    return weights;
}

}  // namespace ols
