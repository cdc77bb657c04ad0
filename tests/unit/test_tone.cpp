// SPDX-License-Identifier: MIT
// The preview's tone curve, the sRGB transfer and the PNG files they end in.
// links: opencv_imgcodecs ols_image
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "image/png.hpp"
#include "image/tone.hpp"

namespace ols {
namespace {

std::string scratch(const std::string& name) {
    return testing::TempDir() + "ols_tone_" + name;
}

TEST(Tone, below_the_knee_nothing_changes_and_white_is_never_passed) {
    for (float x : {0.0f, 0.18f, 0.5f, 0.6f}) EXPECT_EQ(tone_curve(x), x);
    EXPECT_LE(tone_curve(1e30f), 1.0f);
    EXPECT_GT(tone_curve(4.0f), 0.99f);
}

TEST(Tone, the_curve_rises_without_a_kink) {
    float before = -1;
    for (float x = 0; x < 3; x += 0.01f) {
        EXPECT_GT(tone_curve(x), before);
        before = tone_curve(x);
    }
    const float h = 1e-3f;
    EXPECT_NEAR((tone_curve(0.6f + h) - tone_curve(0.6f)) / h, 1, 5e-3);
}

TEST(Tone, negative_and_not_a_number_are_black) {
    EXPECT_EQ(tone_curve(-1), 0);
    EXPECT_EQ(tone_curve(std::numeric_limits<float>::quiet_NaN()), 0);
    EXPECT_EQ(tone_curve(std::numeric_limits<float>::infinity()), 1);
}

TEST(Tone, srgb_meets_the_code_values_of_its_standard) {
    EXPECT_NEAR(srgb_encode(0.18f) * 255, 117.6, 0.1);
    EXPECT_NEAR(srgb_encode(0.5f) * 255, 187.5, 0.1);
    EXPECT_NEAR(srgb_encode(1.0f), 1, 1e-6);
    for (int code = 0; code < 256; ++code) EXPECT_NEAR(srgb_encode(srgb_decode(code / 255.0f)) * 255, code, 2e-3);
}

TEST(Png, another_reader_sees_the_pixels_in_their_order) {
    Image image(2, 1, 3);
    image.data = {0.18f, 0, 0, 0, 0.5f, 9};
    const auto path = scratch("order.png");
    ASSERT_TRUE(write_png_preview(path, image).ok());
    const cv::Mat bgr = cv::imread(path, cv::IMREAD_UNCHANGED);
    ASSERT_EQ(bgr.type(), CV_8UC3);
    EXPECT_EQ(bgr.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 118));
    EXPECT_EQ(bgr.at<cv::Vec3b>(0, 1), cv::Vec3b(255, 188, 0));
    std::filesystem::remove(path);
}

TEST(Png, a_folder_that_is_not_there_is_named_and_nothing_is_left) {
    const auto status = write_png_preview(scratch("no_folder/x.png"), Image(2, 2, 3));
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.error().message.find("no_folder/x.png"), std::string::npos);
}

TEST(Png, a_full_disk_leaves_no_file) {
    // A limit on file size stands for the full disk: the write fails half-way.
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const rlimit small{1000, before.rlim_max};
    Image noise(100, 100, 3);
    for (size_t i = 0; i < noise.data.size(); ++i) noise.data[i] = float(i * 7919 % 1009) / 1009;
    const std::filesystem::path folder = scratch("full");
    std::filesystem::create_directories(folder);
    setrlimit(RLIMIT_FSIZE, &small);
    const auto status = write_png_preview((folder / "x.png").string(), noise);
    setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_FALSE(status.ok());
    EXPECT_TRUE(std::filesystem::is_empty(folder));
    std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace ols
