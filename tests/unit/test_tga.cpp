// SPDX-License-Identifier: MIT
// TGA files written byte by byte after the specification: corners, run lengths, alpha, and what is refused.
// links: ols_image
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "image/tga.hpp"

using namespace ols;

namespace {

using Bytes = std::vector<int>;

// A header for width x height pixels, then `pixels` as they are.
Bytes tga(int type, int width, int height, int bits, int descriptor, const Bytes& pixels) {
    Bytes file = {0,           0,          type,         0,           0,    0,         0, 0, 0, 0, 0, 0,
                  width & 255, width >> 8, height & 255, height >> 8, bits, descriptor};
    file.insert(file.end(), pixels.begin(), pixels.end());
    return file;
}

std::string file_of(const Bytes& bytes) {
    const auto path = std::filesystem::temp_directory_path() / ("tga" + std::to_string(getpid()) + ".tga");
    std::ofstream file(path, std::ios::binary);
    for (const int b : bytes) file.put(char(b));
    return path;
}

Image read(const Bytes& bytes) {
    auto image = read_tga(file_of(bytes));
    EXPECT_TRUE(image.ok()) << image.error().message;
    return *image;
}

constexpr int top_left = 32, top_right = 32 + 16, bottom_left = 0;

}  // namespace

TEST(Tga, blue_green_red_becomes_red_green_blue) {
    const Image image = read(tga(2, 2, 1, 24, top_left, {1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(image.data, (std::vector<float>{3, 2, 1, 6, 5, 4}));
}

TEST(Tga, every_corner_may_come_first) {
    const Bytes pixels = {1, 2, 3, 4, 5, 6};  // two rows of three
    EXPECT_EQ(read(tga(3, 3, 2, 8, top_left, pixels)).data, (std::vector<float>{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(read(tga(3, 3, 2, 8, bottom_left, pixels)).data, (std::vector<float>{4, 5, 6, 1, 2, 3}));
    EXPECT_EQ(read(tga(3, 3, 2, 8, top_right, pixels)).data, (std::vector<float>{3, 2, 1, 6, 5, 4}));
}

TEST(Tga, run_lengths_may_cross_rows_and_alpha_is_left_out) {
    // Four times (30, 20, 10), then two plain pixels.
    const Bytes packets = {128 + 3, 10, 20, 30, 255, 1, 1, 2, 3, 255, 4, 5, 6, 255};
    const Image image = read(tga(10, 3, 2, 32, top_left, packets));
    EXPECT_EQ(image.data, (std::vector<float>{30, 20, 10, 30, 20, 10, 30, 20, 10, 30, 20, 10, 3, 2, 1, 6, 5, 4}));
}

TEST(Tga, an_identification_text_before_the_pixels_is_skipped) {
    Bytes file = tga(3, 2, 1, 8, top_left, {'h', 'i', 7, 8});
    file[0] = 2;
    EXPECT_EQ(read(file).data, (std::vector<float>{7, 8}));
}

TEST(Tga, short_mapped_and_odd_files_are_refused_by_name) {
    for (const auto& [file, why] :
         std::vector<std::pair<Bytes, std::string>>{{{0, 0, 2}, "too short"},
                                                    {tga(2, 2, 2, 24, 0, {1, 2, 3}), "ends early"},
                                                    {tga(10, 20, 20, 24, 0, {255, 1, 2, 3}), "ends early"},
                                                    {tga(10, 2, 1, 24, 0, {}), "ends early"},
                                                    {tga(10, 65535, 65535, 32, 0, {255, 1, 2, 3, 4}), "ends early"},
                                                    {tga(2, 65535, 65535, 32, 0, {1, 2, 3, 4}), "ends early"},
                                                    {tga(1, 2, 2, 8, 0, {0, 0, 0, 0}), "colour-mapped"},
                                                    {tga(2, 2, 1, 16, 0, {0, 0, 0, 0}), "16 bits"},
                                                    {tga(2, 0, 5, 24, 0, {}), "no pixels"}}) {
        const auto image = read_tga(file_of(file));
        ASSERT_FALSE(image.ok()) << why;
        EXPECT_NE(image.error().message.find(why), std::string::npos) << image.error().message;
        EXPECT_NE(image.error().message.find(".tga'"), std::string::npos);
    }
    EXPECT_FALSE(read_tga("/nonexistent.tga").ok());
}
