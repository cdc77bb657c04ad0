// SPDX-License-Identifier: MIT
// Luminance and chroma against the OpenEXR library's own reader of R G B A.
// links: ols_image
#include <ImfRgbaFile.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "image/exr.hpp"

namespace ols {
namespace {

constexpr int width = 48, height = 32;

std::string file_path(const char* name) {
    return std::filesystem::temp_directory_path() / (std::to_string(getpid()) + name);
}

std::vector<Imf::Rgba> smooth_colours() {
    std::vector<Imf::Rgba> pixels(width * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            pixels[size_t(y * width + x)] =
                Imf::Rgba(1 + 0.5f * std::sin(x / 9.f), 2 + std::cos(y / 7.f), 0.7f + 0.02f * y);
    return pixels;
}

TEST(ExrChroma, halved_chroma_is_interpolated_as_the_library_does) {
    const std::string path = file_path("chroma.exr");
    const auto pixels = smooth_colours();
    {
        Imf::RgbaOutputFile file(path.c_str(), width, height, Imf::WRITE_YC);
        file.setFrameBuffer(pixels.data(), 1, width);
        file.writePixels(height);
    }
    std::vector<Imf::Rgba> truth(pixels.size());
    Imf::RgbaInputFile file(path.c_str());
    file.setFrameBuffer(truth.data(), 1, width);
    file.readPixels(0, height - 1);

    const auto picture = read_exr_picture(path);
    ASSERT_TRUE(picture.ok()) << picture.error().message;
    ASSERT_EQ(picture->pixels.channels, 3);
    for (size_t i = 0; i < truth.size(); ++i) {
        const float* p = &picture->pixels.data[3 * i];
        const Imf::Rgba& t = truth[i];
        // The library rounds to halves.
        EXPECT_NEAR(p[0], t.r, t.r / 1024) << i;
        EXPECT_NEAR(p[1], t.g, t.g / 1024) << i;
        EXPECT_NEAR(p[2], t.b, t.b / 1024) << i;
    }
    std::filesystem::remove(path);
}

}  // namespace
}  // namespace ols
