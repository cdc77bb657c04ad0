// SPDX-License-Identifier: MIT
// Calibration folders, and the block means that the optical code looks at.
// links: ols_record
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "image/exr.hpp"
#include "stage/calibration.hpp"
#include "summarize_frame.hpp"

using namespace ols;
using test::summarize_frame;

namespace {

class CalibrationFolder : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / ("calibration" + std::to_string(getpid()));
        stage_ = default_stage();
        stage_.cameras[0].width = 20;
        stage_.cameras[0].height = 10;
        calibration_ = nominal_calibration(stage_);
        calibration_.cameras[0].black.at(3, 4) = 65.25f;
        calibration_.cameras[0].flat.at(19, 9) = 1.875f;
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string error() {
        const auto read = read_calibration(folder_, stage_);
        return read.ok() ? "" : read.error().message;
    }

    std::filesystem::path folder_;
    StageConfig stage_;
    Calibration calibration_;
};

Frame flat_frame(uint32_t width, uint32_t height, uint16_t counts) {
    Frame frame;
    frame.width = width;
    frame.height = height;
    frame.pitch_bytes = width * 2;
    frame.samples.resize(width * height * 2);
    auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
    std::fill_n(samples, width * height, counts);
    return frame;
}

}  // namespace

TEST_F(CalibrationFolder, what_is_written_is_read_back) {
    ASSERT_TRUE(write_calibration(folder_, 0, calibration_.cameras[0], {0.985, 24.4, 128}).ok());
    const auto read = read_calibration(folder_, stage_);
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->cameras[0].black.data, calibration_.cameras[0].black.data);
    EXPECT_EQ(read->cameras[0].flat.data, calibration_.cameras[0].flat.data);
    EXPECT_EQ(read->source, folder_.string());
}

TEST_F(CalibrationFolder, another_size_a_value_that_is_none_and_a_missing_file_are_refused_by_name) {
    EXPECT_NE(error().find("calibration.toml"), std::string::npos);
    ASSERT_TRUE(write_calibration(folder_, 0, calibration_.cameras[0], {0.985, 24.4, 128}).ok());
    stage_.cameras[0].width = 21;
    EXPECT_NE(error().find("black.exr"), std::string::npos);
    stage_.cameras[0].width = 20;
    calibration_.cameras[0].flat.at(0, 0) = 0;
    ASSERT_TRUE(write_calibration(folder_, 0, calibration_.cameras[0], {0.985, 24.4, 128}).ok());
    EXPECT_NE(error().find("flat.exr"), std::string::npos);
    calibration_.cameras[0].flat.at(0, 0) = std::numeric_limits<float>::quiet_NaN();
    ASSERT_TRUE(write_calibration(folder_, 0, calibration_.cameras[0], {0.985, 24.4, 128}).ok());
    EXPECT_NE(error().find("stagectl calibrate"), std::string::npos);
    std::filesystem::remove(folder_ / "cam0/black.exr");
    EXPECT_NE(error().find("black.exr"), std::string::npos);
}

TEST_F(CalibrationFolder, each_camera_has_its_part_and_one_that_lacks_is_named) {
    stage_.cameras.push_back(stage_.cameras[0]);
    stage_.cameras[1].width = 30;
    calibration_ = nominal_calibration(stage_);
    calibration_.cameras[1].black.at(29, 9) = 70;
    ASSERT_TRUE(write_calibration(folder_, 1, calibration_.cameras[1], {0.985, 24.4, 128}).ok());
    EXPECT_NE(error().find("camera 0 is not calibrated"), std::string::npos) << error();
    ASSERT_TRUE(write_calibration(folder_, 0, calibration_.cameras[0], {0.985, 24.4, 128}).ok());
    const auto read = read_calibration(folder_, stage_);
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->cameras[0].black.data, calibration_.cameras[0].black.data);
    EXPECT_EQ(read->cameras[1].black.data, calibration_.cameras[1].black.data);
}

TEST(FrameSummary, blocks_are_the_means_of_their_pixels_for_any_size) {
    for (const auto& [width, height] : {std::pair{8, 8}, {13, 11}, {64, 48}, {101, 9}}) {
        Frame frame = flat_frame(uint32_t(width), uint32_t(height), 0);
        auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
        double sums[64] = {};
        int counts[64] = {};
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const auto value = uint16_t(x * 31 + y * 17);
                samples[y * width + x] = value;
                int column = 0;
                while (x >= (column + 1) * width / 8) ++column;
                const int block = y * 8 / height * 8 + column;
                sums[block] += value;
                ++counts[block];
            }
        const FrameSummary summary = summarize_frame(frame, 10, NoiseModel{});
        for (int b = 0; b < 64; ++b) {
            ASSERT_GT(counts[b], 0);
            EXPECT_NEAR(summary.blocks[size_t(b)], sums[b] / counts[b] - 10, 1e-3) << width << " " << b;
        }
        EXPECT_NEAR(summary.noise, 2.68 / std::sqrt(*std::min_element(counts, counts + 64)), 1e-6);
    }
}

TEST(FrameSummary, dark_is_black_within_noise_and_one_lit_block_is_not_dark) {
    Frame frame = flat_frame(64, 48, 64);
    EXPECT_TRUE(is_dark(summarize_frame(frame, 64, NoiseModel{})));
    EXPECT_TRUE(is_dark(summarize_frame(frame, 64.5, NoiseModel{})));
    auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
    for (int y = 6; y < 12; ++y)
        for (int x = 8; x < 16; ++x) samples[y * 64 + x] = 64 + 8;
    EXPECT_FALSE(is_dark(summarize_frame(frame, 64, NoiseModel{})));
}

TEST(FrameSummary, a_sample_that_is_no_number_is_never_dark) {
    Frame frame = flat_frame(16, 16, 0);
    frame.format = PixelFormat::f32;
    frame.pitch_bytes = 16 * 4;
    frame.samples.assign(16 * 16 * 4, std::byte{0});
    EXPECT_TRUE(is_dark(summarize_frame(frame, 0, NoiseModel{})));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    std::memcpy(frame.samples.data() + 100 * 4, &nan, 4);
    EXPECT_FALSE(is_dark(summarize_frame(frame, 0, NoiseModel{})));
}

TEST(FrameSummary, difference_is_zero_for_equal_one_beside_black_and_two_for_disjoint_light) {
    FrameSummary a, b;
    a.blocks[3] = 100;
    b.blocks[7] = 100;
    EXPECT_EQ(difference(a, a), 0);
    EXPECT_EQ(difference(a, b), 2);
    EXPECT_EQ(difference(a, FrameSummary{}), 1);
    b.blocks = a.blocks;
    b.blocks[3] = 80;
    EXPECT_NEAR(difference(a, b), 0.2, 1e-7);
    EXPECT_EQ(difference(FrameSummary{}, FrameSummary{}), 0);
}
