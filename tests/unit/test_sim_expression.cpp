// SPDX-License-Identifier: MIT
// Targets of a mesh and their weights over time.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "scene/geometry.hpp"
#include "scene/scene.hpp"

using namespace ols;

namespace {

class Expressions : public testing::Test {
  protected:
    Expressions() : folder_(std::filesystem::temp_directory_path() / ("expressions" + std::to_string(getpid()))) {
        std::filesystem::create_directories(folder_);
        // A square before the camera, its faces naming the vertices in another order than the file does.
        write("square.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 3 4 1\nf 3 1 2\n");
        write("dent.target", "# a comment\n2 0 0 -0.5\n0 0.25 0 0\n");
    }
    ~Expressions() override { std::filesystem::remove_all(folder_); }

    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << text;
        return folder_ / name;
    }

    Result<Scene> scene(const std::string& object) {
        return read_scene(
            write("scene.toml",
                  "[[material]]\nname = \"m\"\n[[object]]\nmesh = \"square.obj\"\nmaterial = \"m\"\n" + object));
    }

    std::filesystem::path folder_;
};

constexpr const char* dented =
    "scale = 2\n[[object.expression]]\ntarget = \"dent.target\"\n"
    "[[object.expression.key]]\ntime_us = 0\nweight = 0\n[[object.expression.key]]\ntime_us = 100\nweight = 1\n";

}  // namespace

TEST_F(Expressions, move_the_vertices_that_the_file_numbers_whatever_order_faces_name_them_in) {
    const auto mesh = read_mesh(folder_ / "square.obj");
    const auto target = read_target(folder_ / "dent.target", *mesh);
    ASSERT_TRUE(target) << target.error().message;
    const Expression dent{"dent", *target, {}, 0};
    const auto moved = deformed_positions(*mesh, {dent}, {0.5});
    for (size_t i = 0; i < moved.size(); ++i) {
        Float3 expected = mesh->positions[i];
        if (expected == Float3{1, 1, 0}) expected.z = -0.25f;
        if (expected == Float3{-1, -1, 0}) expected.x = -0.875f;
        EXPECT_EQ(moved[i], expected);
    }
}

TEST_F(Expressions, run_along_half_cosines_and_repeat_with_their_period) {
    Expression e{"", {}, {{0, 0}, {100, 1}, {300, -0.5}}, 0};
    EXPECT_DOUBLE_EQ(weight_at(e, -5), 0);
    EXPECT_NEAR(weight_at(e, 50), 0.5, 1e-12);
    EXPECT_NEAR(weight_at(e, 25), (1 - std::sqrt(0.5)) / 2, 1e-12);
    EXPECT_NEAR(weight_at(e, 200), 0.25, 1e-12);
    EXPECT_DOUBLE_EQ(weight_at(e, 1e9), -0.5);
    e.period_us = 400;
    EXPECT_NEAR(weight_at(e, 4 * 400 + 50), 0.5, 1e-12);
    EXPECT_TRUE(moves(e));
    e.keys = {{0, 0.3}, {5, 0.3}};
    EXPECT_FALSE(moves(e));
}

TEST_F(Expressions, a_ray_meets_the_face_as_it_is_set_at_the_time) {
    const auto dent = scene(dented);
    ASSERT_TRUE(dent) << dent.error().message;
    Geometry geometry(*dent, 0);
    // Near the corner (2, 2) of the scaled square, which sinks by 1.
    const Float3 eye{1.9999f, 1.9999f, 5};
    EXPECT_NEAR(geometry.intersect(eye, {0, 0, -1})->position.z, 0, 1e-6);
    const SurfaceHit before = *geometry.intersect(eye, {0, 0, -1});
    EXPECT_TRUE(geometry.place(100));
    const SurfaceHit hit = *geometry.intersect(eye, {0, 0, -1});
    EXPECT_NEAR(hit.position.z, -1, 1e-3);
    // The corner's two triangles now face (4, 0.5, 16) and (0, 3.5, 14), of lengths as their areas.
    EXPECT_NEAR(hit.normal.x, 4 / std::sqrt(932.0), 1e-3);
    EXPECT_NEAR(hit.normal.y, 4 / std::sqrt(932.0), 1e-3);
    EXPECT_NEAR(hit.normal.z, 30 / std::sqrt(932.0), 1e-3);
    // Textures stay with the skin.
    EXPECT_NEAR(hit.rest_position.z, 0, 1e-6);
    EXPECT_NEAR(geometry.position_of(before).z, -1, 1e-3);
    EXPECT_FALSE(geometry.place(100));
}

TEST_F(Expressions, geometry_does_not_depend_on_where_it_was_before) {
    const auto dent = scene(std::string(dented) +
                            "[[object.motion]]\ntime_us = 0\n[[object.motion]]\ntime_us = 100\nangle_deg = 30\n");
    ASSERT_TRUE(dent) << dent.error().message;
    Geometry fresh(*dent, 60), used(*dent, 100);
    used.place(10);
    used.place(60);
    for (int i = 0; i < 400; ++i) {
        const Float3 eye{-1.5f + 0.15f * float(i % 20), -1.5f + 0.15f * float(i / 20), 5};
        const auto a = fresh.intersect(eye, {0, 0, -1}), b = used.intersect(eye, {0, 0, -1});
        ASSERT_EQ(a.has_value(), b.has_value());
        if (!a) continue;
        ASSERT_EQ(a->position, b->position);
        ASSERT_EQ(a->normal, b->normal);
    }
}

TEST_F(Expressions, of_what_cannot_be_used_are_errors_that_say_where) {
    const auto mesh = read_mesh(folder_ / "square.obj");
    const auto complaint = [&](const std::string& text) {
        const auto target = read_target(write("bad.target", text), *mesh);
        return target ? "" : target.error().message;
    };
    EXPECT_NE(complaint("1 0 0 nan\n").find("bad.target:1"), std::string::npos);
    EXPECT_NE(complaint("0 0 0 1\n4 0 0 1\n").find("no vertex 4"), std::string::npos);
    EXPECT_NE(complaint("0 0 1\n").find("vertex dx dy dz"), std::string::npos);
    EXPECT_NE(complaint("0 0 0 1\n0 0 0 2\n").find("twice"), std::string::npos);
    EXPECT_NE(complaint("-1 0 0 1\n").find("no vertex -1"), std::string::npos);
    EXPECT_NE(complaint("# nothing\n").find("moves no vertex"), std::string::npos);
    EXPECT_NE(read_target("/nonexistent.target", *mesh).error().message.find("make assets"), std::string::npos);

    const auto backwards = scene(
        "[[object.expression]]\ntarget = \"dent.target\"\n[[object.expression.key]]\ntime_us = 5\n"
        "[[object.expression.key]]\ntime_us = 5\nweight = 1\n");
    ASSERT_FALSE(backwards);
    EXPECT_NE(backwards.error().message.find("later than the key before"), std::string::npos);
    write("square.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
    const auto hard = scene(dented);
    ASSERT_FALSE(hard);
    EXPECT_NE(hard.error().message.find("has no normals"), std::string::npos);
}
