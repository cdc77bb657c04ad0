// SPDX-License-Identifier: MIT
// Radiance pictures too wide to be maps.
// links: ols_image
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "image/radiance.hpp"

namespace ols {
namespace {

// Rows of more than 32767 pixels never have the new coding, whatever they begin with (Radiance's MAXELEN).
TEST(Radiance, wide_rows_are_flat_or_have_old_runs) {
    const std::string path = std::filesystem::temp_directory_path() / (std::to_string(getpid()) + "wide.hdr");
    constexpr int width = 40000;
    std::string flat, runs;
    for (int x = 0; x < width; ++x) flat += x == 0 ? "\x02\x02\x40\x88" : "\x10\x20\x40\x89";
    runs = std::string("\x02\x02\x40\x88\x10\x20\x40\x89");
    const int left = width - 2;  // 156 * 256 + 62
    runs += std::string("\x01\x01\x01", 3) + char(left & 255);
    runs += std::string("\x01\x01\x01", 3) + char(left >> 8);
    for (const auto& rows : {flat, runs}) {
        std::ofstream(path, std::ios::binary) << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X " << width << "\n"
                                              << rows;
        const auto picture = read_radiance(path);
        ASSERT_TRUE(picture.ok()) << picture.error().message;
        ASSERT_EQ(picture->pixels.width, width);
        EXPECT_TRUE(picture->said.empty());
        EXPECT_FLOAT_EQ(picture->pixels.at(0, 0, 2), 64.0f);
        for (int x = 1; x < width; ++x) {
            ASSERT_FLOAT_EQ(picture->pixels.at(x, 0, 0), 32.0f) << x;
            ASSERT_FLOAT_EQ(picture->pixels.at(x, 0, 2), 128.0f) << x;
        }
    }
    std::filesystem::remove(path);
}

}  // namespace
}  // namespace ols
