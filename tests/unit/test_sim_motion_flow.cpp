// SPDX-License-Identifier: MIT
// True flow against closed forms, and against pictures.
// links: ols_stagesim
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "render/renderer.hpp"
#include "render/true_flow.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

constexpr double second_us = 1e6;

CameraConfig camera_of(int width, int height) {
    return small_stage({{0, 0, 1}}, width, height).cameras[0];
}

// Pixels a metre in the plane z = depth_m before the default camera at z = 1.6.
double pixels_per_m(const CameraConfig& camera, double depth_m) {
    return camera.height / (2 * std::tan(camera.vertical_fov_deg / 2 * std::numbers::pi / 180) * (1.6 - depth_m));
}

Scene card(Vec3 center_m, double size_m, std::vector<Keyframe> motion) {
    Scene scene;
    add_quad(scene, center_m, {0, 0, 1}, {0, 1, 0}, size_m, matte(0.5f));
    scene.objects[0].motion = std::move(motion);
    return scene;
}

}  // namespace

TEST(TrueFlow, of_a_card_turning_in_the_image_plane_is_that_rotation) {
    const CameraConfig camera = camera_of(64, 48);
    const Scene scene =
        card({}, 2, {{0, {}, rotation_about({0, 0, 1}, 0)}, {second_us, {}, rotation_about({0, 0, 1}, 60)}});
    const TrueFlow truth = true_flow(scene, camera, 100'000, 350'000);
    // 15 degrees counterclockwise as the camera sees it; image rows go down.
    const double a = 15 * std::numbers::pi / 180;
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 64; ++x) {
            const double right = x + 0.5 - 32, up = 24 - (y + 0.5);
            const size_t i = size_t(y) * 64 + size_t(x);
            ASSERT_NEAR(truth.flow.u[i], std::cos(a) * right - std::sin(a) * up - right, 2e-4);
            ASSERT_NEAR(truth.flow.v[i], -(std::sin(a) * right + std::cos(a) * up - up), 2e-4);
        }
}

TEST(TrueFlow, of_a_translation_is_its_projection_and_says_what_leaves_the_image) {
    const CameraConfig camera = camera_of(64, 48);
    const Scene scene = card({0, 0, 0.1}, 2, {{0, {}, {1, 0, 0, 0}}, {second_us, {0.1, -0.02, 0}, {1, 0, 0, 0}}});
    const TrueFlow truth = true_flow(scene, camera, 0, second_us);
    const double scale = pixels_per_m(camera, 0.1);
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 64; ++x) {
            const size_t i = size_t(y) * 64 + size_t(x);
            ASSERT_NEAR(truth.flow.u[i], 0.1 * scale, 2e-4);
            ASSERT_NEAR(truth.flow.v[i], 0.02 * scale, 2e-4);
            const bool stays = x + 0.5 + 0.1 * scale <= 64 && y + 0.5 + 0.02 * scale <= 48;
            EXPECT_EQ(truth.visible[i], stays) << x << ' ' << y;
        }
}

TEST(TrueFlow, says_what_another_object_hides_and_is_nan_where_nothing_is) {
    const CameraConfig camera = camera_of(64, 48);
    Scene scene = card({0, 0, 0}, 0.2, {});
    // A smaller card 0.3 m nearer comes from far left and ends in the middle of the image.
    add_quad(scene, {0, 0, 0.3}, {0, 0, 1}, {0, 1, 0}, 0.05, matte(0.5f));
    scene.objects[1].motion = {{0, {-1, 0, 0}, {1, 0, 0, 0}}, {second_us, {0, 0, 0}, {1, 0, 0, 0}}};
    const TrueFlow truth = true_flow(scene, camera, 0, second_us);
    const double half_far = 0.1 * pixels_per_m(camera, 0), half_near = 0.025 * pixels_per_m(camera, 0.3);
    int hidden = 0;
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 64; ++x) {
            const size_t i = size_t(y) * 64 + size_t(x);
            const double r = std::max(std::abs(x + 0.5 - 32), std::abs(y + 0.5 - 24));
            // Rays that graze a border may go either way.
            if (std::abs(r - half_far) < 0.01 || std::abs(r - half_near) < 0.01) continue;
            ASSERT_EQ(std::isnan(truth.flow.u[i]), r > half_far) << x << ' ' << y;
            ASSERT_EQ(truth.visible[i], r < half_far && r > half_near) << x << ' ' << y;
            hidden += r < half_near;
        }
    EXPECT_GT(hidden, 20);
}

// An evenly lit textured ball turning by 8 degrees: what is seen at the end, at the end of the flow, is what was seen at
// the beginning. Both pictures are of 64 samples a pixel and compared away from the silhouette; what remains is the
// interpolation of the second one.
TEST(TrueFlow, leads_from_a_picture_to_the_same_colours_in_the_other) {
    Scene scene;
    Material fur = matte(0.4f);
    fur.type = MaterialType::hair;
    add_sphere(scene, {}, 0.15, fur);
    scene.objects[0].motion = {{0, {}, rotation_about({0, 1, 0}, -4)}, {second_us, {}, rotation_about({0.2, 1, 0}, 4)}};
    scene.samples = 64;
    // Six lamps along the axes: for a matte ball nearly even; their unevenness stands still while the texture moves, so
    // albedo is compared, not light: both are divided by the picture of a plain ball.
    const StageConfig stage =
        small_stage({{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}, 192, 144);
    Scene plain;
    add_sphere(plain, {}, 0.15, matte(0.4f));
    plain.samples = 64;
    const CameraConfig& camera = stage.cameras[0];
    Renderer textured({scene, stage, camera, false}, {}), even({plain, stage, camera, false}, {});
    const std::vector<Float3> all(6, {1, 1, 1});
    Image before = textured.light(all, 0), after = textured.light(all, second_us);
    const Image light = even.light(all, 0);
    for (size_t i = 0; i < light.data.size(); ++i) {
        const float l = std::max(light.data[i], 1e-3f);
        before.data[i] /= l, after.data[i] /= l;
    }
    const TrueFlow truth = true_flow(scene, camera, 0, second_us);

    double with_flow = 0, without = 0, spread = 0;
    int n = 0;
    for (int y = 12; y < 132; ++y)
        for (int x = 36; x < 156; ++x) {
            const size_t i = size_t(y) * 192 + size_t(x);
            const double from_middle = std::hypot(x + 0.5 - 96, y + 0.5 - 72);
            if (from_middle > 0.105 * pixels_per_m(camera, 0)) continue;
            ASSERT_TRUE(truth.visible[i]);
            const double tx = x + truth.flow.u[i], ty = y + truth.flow.v[i];
            const int x0 = int(std::floor(tx)), y0 = int(std::floor(ty));
            const double fx = tx - x0, fy = ty - y0;
            const double there = (1 - fy) * ((1 - fx) * after.at(x0, y0) + fx * after.at(x0 + 1, y0)) +
                                 fy * ((1 - fx) * after.at(x0, y0 + 1) + fx * after.at(x0 + 1, y0 + 1));
            with_flow += std::pow(there - before.at(x, y), 2);
            without += std::pow(after.at(x, y) - before.at(x, y), 2);
            spread += std::pow(before.at(x, y) - 1, 2);
            ++n;
        }
    ASSERT_GT(n, 1500);
    ASSERT_GT(spread / n, 0.01);  // there is a texture
    // Bilinear interpolation of strands some two pixels wide keeps most of their contrast; a flow that is a pixel off
    // keeps nothing.
    EXPECT_LT(with_flow, 0.1 * without);
}

TEST(TrueFlow, of_what_does_not_move_is_zero) {
    const CameraConfig camera = camera_of(32, 24);
    const TrueFlow truth = true_flow(card({}, 2, {}), camera, 0, second_us);
    for (size_t i = 0; i < truth.flow.size(); ++i) {
        ASSERT_EQ(truth.flow.u[i], 0);
        ASSERT_EQ(truth.flow.v[i], 0);
        ASSERT_TRUE(truth.visible[i]);
    }
}

TEST(TrueFlow, a_file_that_cannot_be_written_is_an_error_and_leaves_nothing) {
    const TrueFlow truth = true_flow(card({}, 2, {}), camera_of(8, 6), 0, 1);
    const Status status = write_true_flow("/nonexistent/flow.exr", truth, 0, 1);
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message.find("/nonexistent/flow.exr"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists("/nonexistent"));
}
