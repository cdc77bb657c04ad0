// SPDX-License-Identifier: MIT
// Scene and mesh files as users write them, right and wrong.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "scene/scene.hpp"

using namespace ols;

namespace {

class SceneFiles : public testing::Test {
  protected:
    SceneFiles() : folder_(std::filesystem::temp_directory_path() / ("scene" + std::to_string(getpid()))) {
        std::filesystem::create_directories(folder_);
    }
    ~SceneFiles() override { std::filesystem::remove_all(folder_); }

    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << text;
        return folder_ / name;
    }
    std::string scene_error(const std::string& text) {
        const auto scene = read_scene(write("scene.toml", text));
        return scene.ok() ? "" : scene.error().message;
    }
    std::string mesh_error(const std::string& text) {
        const auto mesh = read_mesh(write("mesh.obj", text));
        return mesh.ok() ? "" : mesh.error().message;
    }

    std::filesystem::path folder_;
};

const char* const one_sphere =
    "[[material]]\nname = \"m\"\n[[object]]\nmaterial = \"m\"\nsphere = { radius_m = 0.1 }\n";

}  // namespace

TEST_F(SceneFiles, a_scene_of_every_shape_is_read) {
    write("two.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng left\nf 1 2 3\ng right\nf 1 3 4\n");
    const auto scene =
        read_scene(write("scene.toml",
                         "samples = 9\nseed = 5\n[clock]\ndrift_ppm = 3.5\n[[material]]\nname = \"a\"\n"
                         "albedo = [0.1, 0.2, 0.3]\n[[material]]\nname = \"b\"\nf0 = 0.04\n"
                         "[[object]]\nmesh = \"two.obj\"\nmaterial = \"a\"\nmaterials = { right = \"b\" }\n"
                         "scale = 0.1\nposition_m = [0, 0, 1]\n"
                         "[[object]]\nquad = { width_m = 2 }\nmaterial = \"a\"\n[board]\n"));
    ASSERT_TRUE(scene.ok()) << scene.error().message;
    EXPECT_EQ(scene->samples, 9);
    EXPECT_EQ(scene->clock.drift_ppm, 3.5);
    ASSERT_EQ(scene->objects.size(), 3u);
    EXPECT_EQ(scene->objects[0].material_of_group, (std::vector<uint32_t>{0, 1}));
    const Mesh& mesh = std::get<Mesh>(scene->objects[0].shape);
    EXPECT_NEAR(mesh.positions[2].x, 0.1, 1e-7);
    EXPECT_NEAR(mesh.positions[2].z, 1, 1e-7);
    EXPECT_TRUE(scene->objects[2].is_board);
}

TEST_F(SceneFiles, mistakes_are_named_with_file_line_and_key) {
    const std::string good = one_sphere;
    EXPECT_EQ(scene_error(good), "");
    EXPECT_NE(scene_error("sample = 4\n" + good).find("scene.toml:1: sample "), std::string::npos);
    EXPECT_NE(scene_error("samples = 5\n" + good).find("square number"), std::string::npos);
    EXPECT_NE(scene_error(good + "colour = 1\n").find(":6: object.colour"), std::string::npos);
    EXPECT_NE(scene_error("[[object]]\nmaterial = \"x\"\nsphere = {}\n").find("no [[material]] has that name"),
              std::string::npos);
    EXPECT_NE(scene_error("[[material]]\nname = \"m\"\nalbedo = [2, 0, 0]\n" + good).find("from 0 to 1"),
              std::string::npos);
    EXPECT_NE(scene_error("samples = \n").find("scene.toml:1"), std::string::npos);
    EXPECT_NE(scene_error("samples = 1\n").find("scene is empty"), std::string::npos);
    EXPECT_NE(
        scene_error("[[material]]\nname = \"m\"\n[[object]]\nmaterial = \"m\"\nmesh = \"none.obj\"\n").find("none.obj"),
        std::string::npos);
    EXPECT_NE(scene_error(good + "[[object.motion]]\ntime_us = 5\n[[object.motion]]\ntime_us = 5\n").find("later"),
              std::string::npos);
    EXPECT_FALSE(read_scene("/nonexistent.toml").ok());
}

TEST_F(SceneFiles, meshes_have_smooth_normals_masks_and_groups) {
    // A square pyramid without its base: the apex normal is +z by symmetry.
    const auto mesh = read_mesh(write("pyramid.obj",
                                      "v 1 1 0 1 0 0\r\nv -1 1 0\nv -1 -1 0\nv 1 -1 0\nv 0 0 1 0.25 0.5 0.75\n"
                                      "g north\nf 1/7 2/8 5/9\nf 2 3 5\ng south\nf -3 -2 -1\nf 4 1 5\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.error().message;
    ASSERT_EQ(mesh->triangles.size(), 4u);
    EXPECT_EQ(mesh->groups, (std::vector<std::string>{"north", "south"}));
    EXPECT_EQ(mesh->triangles[2].group, 1u);
    for (size_t i = 0; i < mesh->positions.size(); ++i)
        if (mesh->positions[i].z == 1) {
            EXPECT_NEAR(mesh->normals[i].z, 1, 1e-6);
            EXPECT_EQ(mesh->masks[i], (Float3{0.25f, 0.5f, 0.75f}));
        }
}

TEST_F(SceneFiles, polygons_become_fans_and_given_normals_are_kept) {
    const auto mesh =
        read_mesh(write("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 2\nvn 1 0 0\nf 1//1 2//1 3//1 4//2\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.error().message;
    EXPECT_EQ(mesh->triangles.size(), 2u);
    EXPECT_EQ(mesh->normals[0], (Float3{0, 0, 1}));
    EXPECT_EQ(mesh->normals[3], (Float3{1, 0, 0}));
}

TEST_F(SceneFiles, broken_meshes_are_errors_that_name_the_line) {
    EXPECT_NE(mesh_error("v 0 0 0\nf 1 2 3\n").find("mesh.obj:2:"), std::string::npos);
    EXPECT_NE(mesh_error("v 0 0 nan\n").find(":1:"), std::string::npos);
    EXPECT_NE(mesh_error("v 0 0\n").find(":1:"), std::string::npos);
    EXPECT_NE(mesh_error("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 0\n").find(":4:"), std::string::npos);
    EXPECT_NE(mesh_error("v 0 0 0\nv 0 0 0\nf 1 2\n").find(":3:"), std::string::npos);
    EXPECT_NE(mesh_error("v 0 0 0\n").find("no faces"), std::string::npos);
    EXPECT_NE(read_mesh("/nonexistent.obj").error().message.find("make assets"), std::string::npos);
}
