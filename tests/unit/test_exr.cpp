// SPDX-License-Identifier: MIT
// One-part OpenEXR files: what is written is read back and is what exrheader sees; bad files are named.
// links: ols_image
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>

#include "image/exr.hpp"

using namespace ols;

namespace {

std::string file_path(const char* name) {
    return std::filesystem::temp_directory_path() / (std::to_string(getpid()) + name);
}

Image ramp(int channels) {
    Image image(5, 3, channels);
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i) * 0.37f - 1;
    return image;
}

std::string output_of(const std::string& command) {
    std::string text;
    FILE* pipe = popen(command.c_str(), "r");
    for (char buffer[256]; fgets(buffer, sizeof buffer, pipe);) text += buffer;
    pclose(pipe);
    return text;
}

}  // namespace

TEST(Exr, float_files_keep_every_bit) {
    for (const int channels : {1, 3, 4}) {
        const Image image = ramp(channels);
        ASSERT_TRUE(write_exr(file_path("a.exr"), image, ExrType::single_float).ok());
        const auto back = read_exr(file_path("a.exr"));
        ASSERT_TRUE(back.ok()) << back.error().message;
        EXPECT_EQ(back->channels, channels);
        EXPECT_EQ(back->data, image.data);
    }
}

TEST(Exr, half_files_are_within_half_a_unit_in_the_last_place) {
    const Image image = ramp(3);
    ASSERT_TRUE(write_exr(file_path("b.exr"), image).ok());
    const auto back = read_exr(file_path("b.exr"));
    for (size_t i = 0; i < image.data.size(); ++i)
        EXPECT_NEAR(back->data[i], image.data[i], std::abs(image.data[i]) / 2048 + 1e-7);
}

TEST(Exr, values_beyond_half_become_its_largest_and_never_infinite) {
    Image image(2, 1, 1);
    image.data = {1e9f, -1e9f};
    ASSERT_TRUE(write_exr(file_path("c.exr"), image).ok());
    EXPECT_EQ(read_exr(file_path("c.exr"))->data, (std::vector<float>{65504, -65504}));
}

TEST(Exr, exrheader_sees_channels_and_attributes) {
    ASSERT_TRUE(
        write_exr(file_path("d.exr"), ramp(3), ExrType::half_float, {{"colorInteropID", "lin_rec709_scene"}}).ok());
    const std::string header = output_of("exrheader " + file_path("d.exr"));
    EXPECT_NE(header.find("R, 16-bit floating-point"), std::string::npos) << header;
    EXPECT_NE(header.find("lin_rec709_scene"), std::string::npos);
}

TEST(Exr, a_missing_a_torn_and_a_foreign_file_are_errors_that_name_it) {
    for (const char* name : {"missing.exr", "torn.exr", "text.exr"}) {
        if (std::string(name) == "text.exr") std::ofstream(file_path(name)) << "no image";
        if (std::string(name) == "torn.exr") {
            ASSERT_TRUE(write_exr(file_path(name), ramp(3)).ok());
            std::filesystem::resize_file(file_path(name), std::filesystem::file_size(file_path(name)) - 20);
        }
        const auto image = read_exr(file_path(name));
        ASSERT_FALSE(image.ok()) << name;
        EXPECT_NE(image.error().message.find(name), std::string::npos);
    }
}

TEST(Exr, a_failed_write_leaves_no_file) {
    EXPECT_FALSE(write_exr("/nonexistent/dir/a.exr", ramp(3)).ok());
    EXPECT_FALSE(std::filesystem::exists("/nonexistent/dir"));
}
