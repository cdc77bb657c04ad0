// SPDX-License-Identifier: MIT
// Demosaicing against images whose full colours are known.
// links: ols_image
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "image/demosaic.hpp"

namespace ols {
namespace {

constexpr Cfa patterns[] = {Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg};

Image painted(int width, int height, const std::function<float(int x, int y, int c)>& color) {
    Image rgb(width, height, 3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            for (int c = 0; c < 3; ++c) rgb.at(x, y, c) = color(x, y, c);
    return rgb;
}

Image mosaic_of(const Image& rgb, Cfa cfa) {
    Image mosaic(rgb.width, rgb.height, 1);
    for (int y = 0; y < rgb.height; ++y)
        for (int x = 0; x < rgb.width; ++x) mosaic.at(x, y) = rgb.at(x, y, cfa_color(cfa, x, y));
    return mosaic;
}

double psnr_db(const Image& a, const Image& b) {
    double sum = 0;
    for (size_t i = 0; i < a.data.size(); ++i) sum += std::pow(double(a.data[i]) - b.data[i], 2);
    return -10 * std::log10(sum / a.data.size());
}

// OpenCV's bilinear demosaicing of 16-bit samples; its names say the second row's second and third colours.
Image bilinear_rggb(const Image& mosaic) {
    cv::Mat raw(mosaic.height, mosaic.width, CV_16U), bgr;
    for (int y = 0; y < mosaic.height; ++y)
        for (int x = 0; x < mosaic.width; ++x) raw.at<uint16_t>(y, x) = uint16_t(std::lround(mosaic.at(x, y) * 65535));
    cv::cvtColor(raw, bgr, cv::COLOR_BayerBG2BGR);
    return painted(mosaic.width, mosaic.height,
                   [&](int x, int y, int c) { return bgr.at<cv::Vec3w>(y, x)[2 - c] / 65535.0f; });
}

TEST(Demosaic, a_constant_grey_stays_constant_to_the_border_and_below_zero) {
    for (Cfa cfa : patterns) {
        const Image rgb = painted(7, 6, [](int, int, int) { return -0.25f; });
        const Image got = demosaic(mosaic_of(rgb, cfa), cfa);
        for (float v : got.data) EXPECT_FLOAT_EQ(v, -0.25f);
    }
}

TEST(Demosaic, a_linear_ramp_of_its_own_slope_in_each_colour_is_exact_inside) {
    for (Cfa cfa : patterns) {
        const Image rgb = painted(
            17, 13, [](int x, int y, int c) { return 0.02f * (c + 1) * x - 0.05f * y + 0.03f * c * y - 0.3f * c; });
        const Image got = demosaic(mosaic_of(rgb, cfa), cfa);
        for (int y = 2; y < 11; ++y)
            for (int x = 2; x < 15; ++x)
                for (int c = 0; c < 3; ++c) EXPECT_NEAR(got.at(x, y, c), rgb.at(x, y, c), 1e-5) << x << "," << y;
    }
}

TEST(Demosaic, every_pixel_keeps_the_colour_it_was_seen_in) {
    for (Cfa cfa : patterns) {
        const Image rgb = painted(12, 10, [](int x, int y, int c) { return float((x * 31 + y * 17 + c * 7) % 23); });
        const Image mosaic = mosaic_of(rgb, cfa), got = demosaic(mosaic, cfa);
        for (int y = 0; y < 10; ++y)
            for (int x = 0; x < 12; ++x) EXPECT_EQ(got.at(x, y, cfa_color(cfa, x, y)), mosaic.at(x, y));
    }
}

TEST(Demosaic, the_demosaiced_sum_is_the_sum_of_the_demosaiced) {
    Image a(9, 8, 1), b(9, 8, 1), sum(9, 8, 1);
    for (size_t i = 0; i < a.data.size(); ++i) {
        a.data[i] = float(i * 37 % 29) / 29;
        b.data[i] = float(i * 11 % 31) / 31;
        sum.data[i] = 2 * a.data[i] - 3 * b.data[i];
    }
    const Image da = demosaic(a, Cfa::gbrg), db = demosaic(b, Cfa::gbrg), dsum = demosaic(sum, Cfa::gbrg);
    for (size_t i = 0; i < dsum.data.size(); ++i) EXPECT_NEAR(dsum.data[i], 2 * da.data[i] - 3 * db.data[i], 1e-5);
}

TEST(Demosaic, a_grey_scene_of_rings_comes_out_better_than_bilinear) {
    const Image rgb = painted(128, 128, [](int x, int y, int c) {
        const double r2 = std::pow(x - 64.0, 2) + std::pow(y - 64.0, 2);
        return float((0.5 + 0.4 * std::cos(r2 / 130)) * (1 - 0.15 * c));
    });
    const Image mosaic = mosaic_of(rgb, Cfa::rggb);
    const double ours = psnr_db(demosaic(mosaic, Cfa::rggb), rgb), bilinear = psnr_db(bilinear_rggb(mosaic), rgb);
    RecordProperty("psnr_db", int(ours));
    EXPECT_GT(ours, bilinear + 3) << ours << " dB against " << bilinear;
}

TEST(Demosaic, the_smallest_mosaic_has_its_own_colours_everywhere) {
    Image mosaic(2, 2, 1);
    mosaic.data = {1, 2, 2, 3};  // R G G B
    const Image rgb = demosaic(mosaic, Cfa::rggb);
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(std::isfinite(rgb.data[i * 3]) && std::isfinite(rgb.data[i * 3 + 2]));
    EXPECT_EQ(rgb.at(0, 0, 0), 1);
    EXPECT_EQ(rgb.at(1, 1, 2), 3);
}

TEST(Demosaic, monochrome_becomes_grey_and_colour_is_passed_on) {
    Image grey(2, 1, 1);
    grey.data = {0.5f, -1};
    EXPECT_EQ(as_rgb(grey, Cfa::none).data, (std::vector<float>{0.5f, 0.5f, 0.5f, -1, -1, -1}));
    const Image rgb = painted(2, 2, [](int x, int y, int c) { return float(x + y + c); });
    EXPECT_EQ(as_rgb(rgb, Cfa::rgb).data, rgb.data);
}

}  // namespace
}  // namespace ols
