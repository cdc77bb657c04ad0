// SPDX-License-Identifier: MIT
// Lamp geometry against what Wenger section 3 says of it, and .lp files as other programs write them.
// links: ols_stage
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "stage/lamps.hpp"
#include "stage/light_file.hpp"

using namespace ols;

namespace {

std::string write_file(const std::string& text) {
    static int n = 0;
    const auto path =
        std::filesystem::temp_directory_path() / ("lp" + std::to_string(getpid()) + "_" + std::to_string(n++) + ".lp");
    std::ofstream(path) << text;
    return path;
}

}  // namespace

TEST(Lamps, the_stage_has_156_distinct_unit_directions) {
    const auto lamps = stage_lamp_directions();
    ASSERT_EQ(lamps.size(), 156u);
    for (size_t i = 0; i < lamps.size(); ++i) {
        EXPECT_NEAR(length(lamps[i]), 1, 1e-12);
        for (size_t j = 0; j < i; ++j) EXPECT_GT(length(lamps[i] - lamps[j]), 0.2);
    }
    EXPECT_NEAR(lamps[0].y, 1, 1e-12);
}

TEST(Lamps, the_missing_six_surround_the_south_pole) {
    const auto all = full_sphere_directions();
    ASSERT_EQ(all.size(), 162u);
    EXPECT_NEAR(all[161].y, -1, 1e-12);
    // Half of the 31.717 degrees between a corner of the icosahedron and the middle of its edge.
    for (int i = 156; i < 161; ++i) EXPECT_NEAR(std::acos(-all[i].y) * 180 / std::numbers::pi, 15.859, 0.01);
    EXPECT_GT(all[155].y, all[156].y + 0.05);
}

TEST(Lamps, neighbours_are_about_18_degrees_apart) {
    const auto lamps = full_sphere_directions();
    double sum = 0;
    int n = 0;
    for (const Vec3 a : lamps)
        for (const Vec3 b : lamps) {
            const double angle = std::acos(std::clamp(dot(a, b), -1.0, 1.0)) * 180 / std::numbers::pi;
            if (angle > 1 && angle < 22) sum += angle, ++n;
        }
    // 480 edges of the twice-halved mesh, each seen from both ends.
    EXPECT_EQ(n, 960);
    EXPECT_NEAR(sum / n, 17.5, 1.0);
}

TEST(Lamps, first_moments_vanish_on_the_full_sphere) {
    Vec3 sum;
    for (const Vec3 d : full_sphere_directions()) sum = sum + d;
    EXPECT_NEAR(length(sum), 0, 1e-9);
}

TEST(LightPositions, names_with_spaces_and_decimal_commas_are_read) {
    const auto lights = read_lp(write_file("2\r\nmy image 01.png 0,0 2,0 0\r\n b.png 0.6 0 -0.8\n\n"));
    ASSERT_TRUE(lights.ok()) << lights.error().message;
    EXPECT_EQ((*lights)[0].name, "my image 01.png");
    EXPECT_NEAR((*lights)[0].direction.y, 1, 1e-12);
    EXPECT_EQ((*lights)[1].name, "b.png");
    EXPECT_NEAR((*lights)[1].direction.z, -0.8, 1e-12);
}

TEST(LightPositions, a_round_trip_keeps_directions_to_a_nanoradian) {
    std::vector<LightPosition> lights;
    const auto directions = stage_lamp_directions();
    for (int i = 0; i < 156; ++i) lights.push_back({"lamp_" + std::to_string(1000 + i), directions[i]});
    const std::string path = write_file("");
    ASSERT_TRUE(write_lp(path, lights).ok());
    const auto back = read_lp(path);
    ASSERT_TRUE(back.ok());
    for (int i = 0; i < 156; ++i) EXPECT_LT(length((*back)[i].direction - directions[i]), 2e-9);
}

TEST(LightPositions, a_wrong_count_a_zero_vector_and_prose_are_errors_that_name_the_line) {
    EXPECT_NE(read_lp(write_file("3\na 0 0 1\n")).error().message.find("says 3 lights and lists 1"), std::string::npos);
    EXPECT_NE(read_lp(write_file("1\na 0 0 0\n")).error().message.find(":2:"), std::string::npos);
    EXPECT_NE(read_light_file(write_file("2\na.png 0 0 1 2\nb.png 0 1 0 2 4 8\n"))
                  .error()
                  .message.find(":3: has another number"),
              std::string::npos);
    EXPECT_NE(read_lp(write_file("hello\n")).error().message.find(":1:"), std::string::npos);
    EXPECT_NE(read_lp(write_file("1\na 0 0 nan\n")).error().message.find(":2:"), std::string::npos);
    EXPECT_FALSE(read_lp(write_file("")).ok());
    EXPECT_FALSE(read_lp("/nonexistent.lp").ok());
}
