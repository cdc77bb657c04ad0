// SPDX-License-Identifier: MIT
// Error figures against ones worked out by hand.
// links: ols_image
#include <gtest/gtest.h>

#include <cmath>

#include "image/compare.hpp"

namespace ols {
namespace {

Image image_of(int channels, std::vector<float> data) {
    Image image(int(data.size()) / channels, 1, channels);
    image.data = std::move(data);
    return image;
}

TEST(Compare, figures_are_those_worked_out_by_hand) {
    // Errors +1, -2, 0, 0: mean square 5/4; peak 4.
    const auto d = image_difference(image_of(1, {2, 2, 3, -1}), image_of(1, {1, 4, 3, -1}));
    EXPECT_DOUBLE_EQ(d.peak, 4);
    EXPECT_DOUBLE_EQ(d.rms, std::sqrt(1.25));
    EXPECT_NEAR(d.psnr_db, 10 * std::log10(16 / 1.25), 1e-12);
    EXPECT_DOUBLE_EQ(d.max_error, 2);
    EXPECT_DOUBLE_EQ(d.mean_relative, 3.0 / 9);
    EXPECT_DOUBLE_EQ(d.bias_relative, -1.0 / 9);
}

TEST(Compare, a_peak_that_is_given_is_used) {
    const auto d = image_difference(image_of(1, {1, 0}), image_of(1, {0, 0}), 100);
    EXPECT_NEAR(d.psnr_db, 10 * std::log10(10000 / 0.5), 1e-12);
}

TEST(Compare, alpha_is_not_light) {
    const auto d = image_difference(image_of(4, {1, 2, 3, 0}), image_of(3, {1, 2, 3}));
    EXPECT_EQ(d.rms, 0);
    EXPECT_TRUE(std::isinf(d.psnr_db));
}

TEST(Compare, not_a_number_is_not_hidden) {
    const auto d = image_difference(image_of(1, {1, NAN}), image_of(1, {1, 1}));
    EXPECT_TRUE(std::isnan(d.psnr_db));
    EXPECT_TRUE(std::isnan(d.max_error));
}

}  // namespace
}  // namespace ols
