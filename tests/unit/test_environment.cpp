// SPDX-License-Identifier: MIT
// Reading environment maps, and the solid angles of their texels.
// links: opencv_imgcodecs ols_relight
#include <ImfChannelList.h>
#include <ImfEnvmap.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStandardAttributes.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "image/exr.hpp"
#include "relight/environment.hpp"

namespace ols {
namespace {

constexpr double pi = std::numbers::pi;

struct Scratch {
    std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "ols_environment";
    Scratch() { std::filesystem::create_directories(folder); }
    ~Scratch() { std::filesystem::remove_all(folder); }
    std::string operator/(const std::string& name) const { return (folder / name).string(); }
};

void write_map_with_envmap(const std::string& path, Imf::Envmap kind) {
    std::vector<float> pixels(8 * 4, 1.0f);
    Imf::Header header(8, 4);
    Imf::addEnvmap(header, kind);
    Imf::FrameBuffer buffer;
    for (const char* name : {"R", "G", "B"}) {
        header.channels().insert(name, Imf::Channel(Imf::FLOAT));
        buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data()), 4, 4 * 8));
    }
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(4);
}

TEST(Environment, a_radiance_map_keeps_its_colours_and_its_top_on_top) {
    const Scratch scratch;
    cv::Mat bgr(4, 8, CV_32FC3, cv::Scalar(0.25, 0.25, 0.25));
    bgr.at<cv::Vec3f>(0, 2) = {0.5f, 1, 4};
    cv::imwrite(scratch / "map.HDR", bgr);
    const auto map = read_environment(scratch / "map.HDR");
    ASSERT_TRUE(map.ok()) << map.error().message;
    EXPECT_FLOAT_EQ(map->radiance.at(2, 0, 0), 4);
    EXPECT_FLOAT_EQ(map->radiance.at(2, 0, 1), 1);
    EXPECT_FLOAT_EQ(map->radiance.at(2, 0, 2), 0.5f);
    EXPECT_FLOAT_EQ(map->radiance.at(2, 3, 0), 0.25f);
}

TEST(Environment, a_grey_map_is_white_light) {
    const Scratch scratch;
    Image grey(2, 1, 1);
    grey.data = {0.5f, 2};
    ASSERT_TRUE(write_exr(scratch / "grey.exr", grey).ok());
    EXPECT_EQ(read_environment(scratch / "grey.exr")->radiance.data, (std::vector<float>{0.5f, 0.5f, 0.5f, 2, 2, 2}));
}

TEST(Environment, the_envmap_attribute_is_honoured_and_cube_maps_are_refused_with_a_remedy) {
    const Scratch scratch;
    write_map_with_envmap(scratch / "latlong.exr", Imf::ENVMAP_LATLONG);
    write_map_with_envmap(scratch / "cube.exr", Imf::ENVMAP_CUBE);
    EXPECT_TRUE(read_environment(scratch / "latlong.exr").ok());
    const auto cube = read_environment(scratch / "cube.exr");
    ASSERT_FALSE(cube.ok());
    EXPECT_NE(cube.error().message.find("cube.exr"), std::string::npos);
    EXPECT_NE(cube.error().message.find("exrenvmap -latlong"), std::string::npos);
    // A user who says what the map is knows better than its header.
    EXPECT_TRUE(read_environment(scratch / "cube.exr", EnvConvention::openexr).ok());
}

TEST(Environment, what_cannot_be_read_is_named) {
    const Scratch scratch;
    std::ofstream(scratch / "text.exr") << "no picture";
    std::ofstream(scratch / "text.hdr") << "no picture";
    for (const char* name : {"text.exr", "text.hdr", "nothing.exr", "nothing.hdr"}) {
        const auto map = read_environment(scratch / name);
        ASSERT_FALSE(map.ok()) << name;
        EXPECT_NE(map.error().message.find(name), std::string::npos) << map.error().message;
    }
    ASSERT_TRUE(write_exr(scratch / "wide.exr", Image(4, 2, 3)).ok());
    EXPECT_FALSE(read_environment(scratch / "wide.exr", EnvConvention::angular).ok());
    EXPECT_FALSE(parse_env_convention("latlong").ok());
}

TEST(Environment, texels_of_every_layout_cover_the_sphere_once) {
    for (auto convention : {EnvConvention::openexr, EnvConvention::mirrored, EnvConvention::angular}) {
        double total = 0;
        for (int y = 0; y < 32; ++y)
            for (int x = 0; x < 32; ++x)
                total += env_solid_angle(convention, {x / 32.0, (x + 1) / 32.0, y / 32.0, (y + 1) / 32.0});
        EXPECT_NEAR(total, 4 * pi, convention == EnvConvention::angular ? 1e-3 : 1e-12);
    }
}

// The Jacobian of the direction, by differences, is steradians per area: it checks solid angle and direction together.
TEST(Environment, solid_angle_is_the_area_that_the_directions_sweep) {
    for (auto convention : {EnvConvention::openexr, EnvConvention::mirrored, EnvConvention::angular}) {
        std::mt19937 generator(1);
        std::uniform_real_distribution<double> inside(0.2, 0.8);
        for (int i = 0; i < 200; ++i) {
            const double u = inside(generator), v = inside(generator), h = 1e-4;
            const Vec3 du = env_direction(convention, u + h, v) - env_direction(convention, u - h, v);
            const Vec3 dv = env_direction(convention, u, v + h) - env_direction(convention, u, v - h);
            const double swept = length(cross(du, dv));
            EXPECT_NEAR(env_solid_angle(convention, {u - h, u + h, v - h, v + h}) / swept, 1, 1e-5);
            EXPECT_NEAR(length(env_direction(convention, u, v)), 1, 1e-12);
        }
    }
}

TEST(Environment, reach_bounds_the_angle_to_every_point_of_a_patch) {
    std::mt19937 generator(2);
    std::uniform_real_distribution<double> unit(0, 1);
    for (auto convention : {EnvConvention::openexr, EnvConvention::mirrored, EnvConvention::angular}) {
        for (int i = 0; i < 300; ++i) {
            const double u0 = unit(generator), v0 = unit(generator), size = std::pow(0.5, 1 + i % 8);
            const EnvPatch patch = {u0 * (1 - size), u0 * (1 - size) + size, v0 * (1 - size), v0 * (1 - size) + size};
            const Vec3 middle = env_direction(convention, (patch.u0 + patch.u1) / 2, (patch.v0 + patch.v1) / 2);
            for (int k = 0; k < 40; ++k) {
                const Vec3 point =
                    env_direction(convention, patch.u0 + unit(generator) * size, patch.v0 + unit(generator) * size);
                const double angle = std::atan2(length(cross(middle, point)), dot(middle, point));
                ASSERT_LE(angle, env_reach(convention, patch) + 1e-9);
            }
        }
    }
}

}  // namespace
}  // namespace ols
