// SPDX-License-Identifier: MIT
// Keyframes of rigid motion.
// links: ols_stagesim
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render/renderer.hpp"
#include "sim_scenes.hpp"

using namespace ols;

namespace {

const std::vector<Keyframe> quarter_turn = {{1000, {0, 0, 0}, rotation_about({0, 1, 0}, 0)},
                                            {3000, {0.2, 0, -0.1}, rotation_about({0, 1, 0}, 90)}};

}  // namespace

TEST(Motion, halfway_in_time_is_halfway_in_place_and_angle) {
    const Pose pose = pose_at(quarter_turn, 2000);
    // +z turned by 45 degrees about +y goes towards +x.
    const Float3 turned = pose.turn(Float3{0, 0, 1});
    EXPECT_NEAR(turned.x, std::sqrt(0.5), 1e-6);
    EXPECT_NEAR(turned.z, std::sqrt(0.5), 1e-6);
    const Float3 moved = pose.point({});
    EXPECT_NEAR(moved.x, 0.1, 1e-6);
    EXPECT_NEAR(moved.z, -0.05, 1e-6);
}

TEST(Motion, rotation_is_uniform_along_the_shorter_way) {
    // 350 degrees one way are 10 the other: a tenth of the time turns by 1 degree backwards.
    const std::vector<Keyframe> keyframes = {{0, {}, rotation_about({0, 0, 1}, 0)},
                                             {10, {}, rotation_about({0, 0, 1}, 350)}};
    for (int step = 0; step <= 10; ++step) {
        const Float3 turned = pose_at(keyframes, step).turn(Float3{1, 0, 0});
        EXPECT_NEAR(std::atan2(turned.y, turned.x) * 180 / std::numbers::pi, -step, 1e-4);
    }
}

TEST(Motion, the_pose_is_held_before_the_first_and_after_the_last_keyframe) {
    EXPECT_EQ(pose_at(quarter_turn, 0), pose_at(quarter_turn, 1000));
    EXPECT_EQ(pose_at(quarter_turn, 9e9), pose_at(quarter_turn, 3000));
    EXPECT_EQ(pose_at({}, 5), Pose{});
    EXPECT_TRUE(moves(quarter_turn));
    EXPECT_FALSE(moves({quarter_turn[0], {5000, {}, quarter_turn[0].rotation}}));
}

TEST(Motion, a_moved_object_looks_as_if_it_had_been_placed_there) {
    Scene moving, placed;
    add_sphere(moving, {0, 0, 0}, 0.05, matte(0.5f));
    moving.objects[0].motion = {{0, {}, {1, 0, 0, 0}}, {1000, {0.1, 0.05, 0}, {1, 0, 0, 0}}};
    add_sphere(placed, {0.1, 0.05, 0}, 0.05, matte(0.5f));
    const StageConfig stage = small_stage({{0.3, 0.5, 0.8}});
    Renderer a({moving, stage, stage.cameras[0], false}, {}), b({placed, stage, stage.cameras[0], false}, {});
    const Image before = a.light(one_lamp(1, 0), 0), after = a.light(one_lamp(1, 0), 1000);
    EXPECT_EQ(after.data, b.light(one_lamp(1, 0), 0).data);
    EXPECT_NE(before.data, after.data);
    EXPECT_EQ(a.cost().placings, 2u);
}

// Nothing that is made for the first look depends on where the scene stood then.
TEST(Motion, a_scene_looked_at_beforehand_gives_the_same_pictures) {
    Scene scene;
    Material skin = matte(0.5f);
    skin.type = MaterialType::skin;
    add_quad(scene, {0, 0, 0}, {0, 0, 1}, {0, 1, 0}, 0.1, skin);
    scene.objects[0].motion = {{0, {}, {1, 0, 0, 0}}, {1000, {0.05, 0.02, 0}, rotation_about({0, 1, 0}, 20)}};
    scene.texture_step_m = 1e-3f;
    const StageConfig stage = small_stage({{0.3, 0.5, 0.8}});
    Renderer cold({scene, stage, stage.cameras[0], false}, {}), warm({scene, stage, stage.cameras[0], false}, {});
    warm.place(0);
    for (const double time_us : {700.0, 0.0, 1000.0})
        EXPECT_EQ(warm.light(one_lamp(1, 0), time_us).data, cold.light(one_lamp(1, 0), time_us).data) << time_us;
    EXPECT_EQ(warm.cost().placings, cold.cost().placings + 1);
}
