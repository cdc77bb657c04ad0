// SPDX-License-Identifier: MIT
// Light in the virtual stage against closed forms, and light adding up.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>

#include "render/effects/specular.hpp"
#include "render/renderer.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

// Distance along the ray to a sphere about the origin, negative if it misses.
double hit_sphere(Vec3 origin, Vec3 ray, double radius) {
    const double b = dot(origin, ray), c = dot(origin, origin) - radius * radius, root = b * b - c;
    return root < 0 ? -1 : -b - std::sqrt(root);
}

// A glossy ball, a matte ball and a floor: every effect of light but the board's.
Scene busy_scene() {
    Scene scene;
    Material gloss = matte(0.4f);
    gloss.f0 = 0.05f;
    add_sphere(scene, {-0.06, 0, 0}, 0.08, matte(0.7f));
    add_sphere(scene, {0.08, 0.02, 0.05}, 0.05, gloss);
    add_quad(scene, {0, -0.08, 0}, {0, 1, 0}, {0, 0, -1}, 0.5, matte(0.5f));
    return scene;
}

}  // namespace

TEST(SimLight, a_sphere_under_one_distant_lamp_is_lamberts_cosine) {
    Scene scene;
    add_sphere(scene, {}, 0.12, matte(0.6f));
    scene.samples = 1;
    const Vec3 lamp = normalized(Vec3{0.5, 0.7, 0.4});
    const StageConfig stage = small_stage({lamp}, 160, 120);
    const CameraConfig& camera = stage.cameras[0];
    Renderer renderer({scene, stage, camera, false}, {"falloff"});
    const Image image = renderer.light(one_lamp(1, 0), 0);
    int on_sphere = 0;
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const Vec3 origin{0, 0, 1.6}, ray = default_camera_ray(camera, x, y);
            const double t = hit_sphere(origin, ray, 0.12);
            const double expected = t < 0 ? 0 : 0.6 * std::max(0.0, dot(normalized(origin + ray * t), lamp));
            // Single precision puts a grazing hit a little off.
            const double grazing = t < 0 ? 0 : -dot(normalized(origin + ray * t), ray);
            if (t >= 0 && grazing < 0.1) continue;
            ASSERT_NEAR(image.at(x, y, 1), expected, 5e-5) << x << ' ' << y;
            on_sphere += t >= 0;
        }
    EXPECT_GT(on_sphere, 2000);
}

TEST(SimLight, on_the_axis_light_falls_off_with_the_square_of_the_distance) {
    for (const double z : {-0.4, 0.0, 0.3, 0.6}) {
        Scene scene;
        add_quad(scene, {0, 0, z}, {0, 0, 1}, {0, 1, 0}, 0.02, matte(0.5f));
        const StageConfig stage = small_stage({{0, 0, 1}}, 65, 49);
        Renderer renderer({scene, stage, stage.cameras[0], false}, {});
        // The pixel's samples lie up to 2 mm off the axis.
        EXPECT_NEAR(renderer.light(one_lamp(1, 0), 0).at(32, 24, 0) * (1 - z) * (1 - z), 0.5, 5e-5) << z;
    }
}

TEST(SimLight, the_beam_falls_off_as_a_power_of_the_cosine_from_its_axis) {
    Scene scene;
    add_quad(scene, {0.2, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0.01, matte(1));
    StageConfig stage = small_stage({{0, 0, 1}}, 65, 49);
    stage.lamp_beam_exponent = 3;
    stage.cameras[0].look_at_m = {0.2, 0, 0};
    Renderer renderer({scene, stage, stage.cameras[0], false}, {});
    // Surface and lamp axis make the same angle with the ray: cos / d^2 * cos^3.
    const double squared = 1 + 0.2 * 0.2, cosine = 1 / std::sqrt(squared);
    EXPECT_NEAR(renderer.light(one_lamp(1, 0), 0).at(32, 24, 0), std::pow(cosine, 4) / squared, 1e-4);
}

TEST(SimLight, a_sphere_casts_the_shadow_of_its_tangent_cone) {
    Scene scene;
    scene.samples = 1;
    const double radius = 0.05, height = 0.25, floor = -0.1;
    add_sphere(scene, {0, floor + height, 0}, radius, matte(0.5f));
    add_quad(scene, {0, floor, 0}, {0, 1, 0}, {0, 0, -1}, 0.6, matte(0.5f));
    const StageConfig stage = small_stage({{0, 1, 0}}, 320, 240);
    CameraConfig camera = stage.cameras[0];
    camera.vertical_fov_deg = 16;
    Renderer renderer({scene, stage, camera, false}, {});
    const Image image = renderer.light(one_lamp(1, 0), 0);

    const double lamp_height = 1 - floor, above = lamp_height - height;
    const double shadow = lamp_height * radius / std::sqrt(above * above - radius * radius);
    int dark = 0, lit = 0;
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const Vec3 ray = default_camera_ray(camera, x, y), origin{0, 0, 1.6};
            if (hit_sphere(origin - Vec3{0, floor + height, 0}, ray, radius + 1e-4) > 0 || ray.y >= 0) continue;
            const Vec3 point = origin + ray * (floor / ray.y);
            const double from_axis = std::hypot(point.x, point.z);
            if (std::abs(point.x) > 0.29 || std::abs(point.z) > 0.29 || std::abs(from_axis - shadow) < 1e-3) continue;
            if (from_axis < shadow) {
                ASSERT_EQ(image.at(x, y, 0), 0) << x << ' ' << y;
                ++dark;
            } else {
                ASSERT_GT(image.at(x, y, 0), 0.2) << x << ' ' << y;
                ++lit;
            }
        }
    EXPECT_GT(dark, 30);
    EXPECT_GT(lit, 1000);
}

TEST(SimLight, stray_light_from_the_board_is_its_radiosity_times_the_form_factor_of_a_rectangle) {
    Scene scene;
    // A small patch that faces the board, seen by a camera that stands between them, to the side.
    add_quad(scene, {}, {0, 0, -1}, {0, 1, 0}, 0.02, matte(0.8f));
    add_board(scene, Board{});
    StageConfig stage = small_stage({{0, 0.6, 0.8}}, 33, 33);
    stage.radius_m = 1000;  // even light on the board
    CameraConfig camera = stage.cameras[0];
    camera.position_m = {0.8, 0, -0.3};
    camera.vertical_fov_deg = 0.4;
    Renderer renderer({scene, stage, camera, false}, {});
    const double seen = renderer.light(one_lamp(1, 0), 0).at(16, 16, 0);

    // From a point opposite a corner of a parallel rectangle a x b at distance c (Howell, configuration B-3), four times.
    const double x = 0.3 / 0.5, y = 0.2 / 0.5;
    const double sx = std::sqrt(1 + x * x), sy = std::sqrt(1 + y * y);
    const double factor = 4 / (2 * std::numbers::pi) * (x / sx * std::atan(y / sx) + y / sy * std::atan(x / sy));
    const double radiosity = 0.32 * 0.8;
    EXPECT_NEAR(seen, 0.8 * radiosity * factor, 0.01 * 0.8 * radiosity * factor);

    Renderer without({scene, stage, camera, false}, {"stray"});
    EXPECT_EQ(without.light(one_lamp(1, 0), 0).at(16, 16, 0), 0);
}

TEST(SimLight, the_specular_lobe_reflects_what_its_facets_do_not_send_below_the_surface_and_never_more) {
    // Integral of the lobe with Fresnel 1 over the hemisphere of light, midpoint rule.
    const auto albedo = [](double view_angle, float alpha) {
        const Vec3 view{std::sin(view_angle), 0, std::cos(view_angle)};
        double sum = 0;
        constexpr int rings = 600, sectors = 600;
        for (int i = 0; i < rings; ++i)
            for (int j = 0; j < sectors; ++j) {
                // Rings crowd towards the normal, where a smooth surface's lobe is narrow.
                const double u = (i + 0.5) / rings, z = 1 - u * u, s = std::sqrt(1 - z * z);
                const double phi = 2 * std::numbers::pi * (j + 0.5) / sectors;
                const Vec3 light{s * std::cos(phi), s * std::sin(phi), z}, half = normalized(light + view);
                sum += ggx(float(half.z), float(z), float(view.z), float(dot(half, view)), alpha, 1) * z * 2 * u;
            }
        return sum * 2 * std::numbers::pi / (double(rings) * sectors);
    };
    // At normal incidence facets steeper than 45 degrees reflect downwards: a share alpha^2 / (1 + alpha^2) of them.
    // What is left is dimmed by masking alone, which takes the less the smoother the surface is.
    EXPECT_NEAR(albedo(0, 0.05f), 1 / (1 + 0.05 * 0.05), 2e-3);
    EXPECT_NEAR(albedo(0, 0.2f), 1 / (1 + 0.2 * 0.2), 2e-2);
    EXPECT_LT(albedo(0, 0.2f), 1 / (1 + 0.2 * 0.2));
    for (const double angle : {0.5, 1.0, 1.4}) EXPECT_LT(albedo(angle, 0.3f), 1) << angle;
}

TEST(SimLight, light_adds) {
    const Scene scene = busy_scene();
    const StageConfig stage = small_stage({{0.3, 1, 0.5}, {-0.5, 0.6, 0.7}, {0.8, 0.2, 0.1}});
    Renderer renderer({scene, stage, stage.cameras[0], false}, {});
    const Image a = renderer.light({{1, 1, 1}, {}, {2, 0, 0}}, 0),
                b = renderer.light({{}, {0.5, 0.5, 0.5}, {0, 3, 1}}, 0);
    const Image both = renderer.light({{1, 1, 1}, {0.5, 0.5, 0.5}, {2, 3, 1}}, 0);
    double brightest = 0;
    for (size_t i = 0; i < both.data.size(); ++i) {
        ASSERT_NEAR(a.data[i] + b.data[i], both.data[i], 1e-5);
        brightest = std::max<double>(brightest, both.data[i]);
    }
    EXPECT_GT(brightest, 0.5);
}

TEST(SimLight, the_picture_has_the_same_bits_for_one_thread_and_for_many) {
    const Scene scene = busy_scene();
    const StageConfig stage = small_stage({{0.3, 1, 0.5}, {-0.5, 0.6, 0.7}, {0.8, 0.2, 0.1}});
    const auto expose = [&] {
        Renderer renderer({scene, stage, stage.cameras[0], true}, {});
        return renderer.expose({100, 200, 50}, 0, 7, 0).counts.data;
    };
    const auto many = expose();
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(expose(), many);
}

TEST(SimEffects, what_nobody_calls_for_is_never_evaluated_and_disabling_it_changes_no_bit) {
    Scene scene;
    add_sphere(scene, {}, 0.1, matte(0.5f));
    StageConfig stage = small_stage({{0, 1, 0}, {0.6, 0, 0.8}});
    stage.cameras[0].cfa = Cfa::rgb;
    const ols::Setup setup{scene, stage, stage.cameras[0], true};
    const std::set<std::string> uncalled = {"motion", "beam", "shadows", "specular", "stray", "mosaic", "vignetting"};
    Renderer plain(setup, {}), disabled(setup, uncalled);
    const auto picture = plain.expose({100, 50}, 0, 0, 0).counts.data;
    EXPECT_EQ(picture, disabled.expose({100, 50}, 0, 0, 0).counts.data);
    for (const auto& row : plain.effects().rows()) {
        EXPECT_EQ(row.caller.empty(), uncalled.contains(row.name)) << row.name;
        EXPECT_EQ(row.evaluations == 0, uncalled.contains(row.name)) << row.name;
    }
}

TEST(SimEffects, every_effect_that_is_called_for_changes_the_picture) {
    Scene scene = busy_scene();
    add_board(scene, Board{});
    scene.objects[0].motion = {{0, {}, {1, 0, 0, 0}}, {1000, {0.05, 0, 0}, {1, 0, 0, 0}}};
    StageConfig stage = small_stage({{0.3, 1, 0.5}, {-0.5, 0.6, 0.7}});
    stage.lamp_beam_exponent = 1.2;
    stage.cameras[0].vignetting = 0.25;
    const ols::Setup setup{scene, stage, stage.cameras[0], true};
    const auto expose = [&](const std::set<std::string>& disabled) {
        Renderer renderer(setup, disabled);
        return renderer.expose({300, 100}, 500, 0, 0).counts.data;
    };
    const auto all = expose({});
    for (const std::string& name : effect_names()) EXPECT_NE(expose({name}), all) << name;
}

TEST(SimEffects, names_of_all_effects_are_those_of_the_set) {
    const Scene scene = busy_scene();
    const StageConfig stage = small_stage({{0, 1, 0}});
    std::vector<std::string> names;
    for (const auto& row : EffectSet({scene, stage, stage.cameras[0], true}, {}).rows()) names.push_back(row.name);
    EXPECT_EQ(names, effect_names());
}
