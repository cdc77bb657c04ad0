// SPDX-License-Identifier: MIT
// What shows above noise and how far it is, in images whose edges and noise are known.
// links: ols_flow
#include "flow/evenness.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "flow/flow.hpp"

using namespace ols;

namespace {

constexpr int width = 160, height = 120;

Image filled(float value) {
    Image image(width, height, 1);
    std::ranges::fill(image.data, value);
    return image;
}

Image noisy(Image image, float sigma, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal(0, sigma);
    for (float& v : image.data) v += normal(random);
    return image;
}

Image step_at(int column, float height_of_step) {
    Image image = filled(100);
    for (int y = 0; y < height; ++y)
        for (int x = column; x < width; ++x) image.at(x, y) += height_of_step;
    return image;
}

}  // namespace

TEST(Evenness, sees_nothing_in_noise_alone) {
    // 5 million pixels, where one in 65 million passes; the means' deviation as foretold, but at the border.
    double squares = 0, foretold = 0;
    for (unsigned seed = 0; seed < 250; ++seed) {
        const Evenness evenness = evenness_of(noisy(filled(50), 3, seed), filled(3));
        ASSERT_EQ(std::ranges::min(evenness.reach.data), std::hypot(float(width), float(height))) << seed;
        for (int y = 8; y < height - 8; ++y)
            for (int x = 8; x < width - 8; ++x) {
                squares += std::pow(evenness.mean.at(x, y) - 50, 2);
                foretold += std::pow(evenness.noise.at(x, y), 2);
            }
    }
    EXPECT_NEAR(squares / foretold, 1, 0.02);
}

TEST(Evenness, reaches_to_where_an_edge_begins_to_show) {
    // A step of h through a Gaussian of two pixels has the slope h / (2 sqrt(2 pi)) exp(-d^2 / 8); noise's is
    // sigma / (4 sqrt(8 pi)).
    constexpr double h = 300, sigma = 2;
    const double shows = std::sqrt(-8 * std::log(6 * sigma / (4 * std::sqrt(8 * M_PI)) * 2 * std::sqrt(2 * M_PI) / h));
    const Evenness evenness = evenness_of(step_at(80, h), filled(sigma));
    for (int x = 5; x < 60; ++x) EXPECT_NEAR(evenness.reach.at(x, 60), 79.5 - shows - x, 1);
    EXPECT_EQ(evenness.reach.at(80, 60), 0);
}

TEST(Evenness, does_not_see_a_step_below_the_noise) {
    const Evenness evenness = evenness_of(step_at(80, 0.5f), filled(2));
    EXPECT_GT(std::ranges::min(evenness.reach.data), width);
}

TEST(Evenness, counts_pixels_that_were_not_seen_as_something) {
    Image image = filled(0);
    image.at(40, 30) = std::numeric_limits<float>::quiet_NaN();
    const Evenness evenness = evenness_of(image, filled(2));
    EXPECT_NEAR(evenness.reach.at(43, 34), 5, 1e-4);
    EXPECT_TRUE(std::isfinite(evenness.mean.at(40, 30)));
}

TEST(Evenness, hides_only_what_is_far_from_anything) {
    const Image image = step_at(80, 300);
    const Evenness evenness = evenness_of(image, filled(2));
    const Image hidden = without_even_parts(image, evenness);
    for (int x = 0; x < width; ++x) EXPECT_EQ(std::isnan(hidden.at(x, 60)), evenness.reach.at(x, 60) > 8) << x;
}

TEST(EvenConfidence, forgives_a_miss_between_even_patches_that_look_the_same) {
    const Evenness even = evenness_of(noisy(filled(50), 3, 1), filled(3)),
                   other = evenness_of(noisy(filled(80), 3, 2), filled(3));
    FlowField forward(width, height), backward(width, height);
    std::ranges::fill(forward.u, 6.0f);
    const size_t centre = 60 * width + 80;
    EXPECT_LT(confidence(forward, backward)[centre], 0.1f);
    EXPECT_GT(confidence(forward, backward, even, even)[centre], 0.9f);
    EXPECT_LT(confidence(forward, backward, even, other)[centre], 0.1f) << "another brightness";
}

TEST(EvenConfidence, is_never_less_than_forward_and_backward_say) {
    const Evenness step = evenness_of(step_at(80, 300), filled(2));
    FlowField forward(width, height), backward(width, height);
    std::mt19937 random(5);
    for (FlowField* flow : {&forward, &backward})
        for (float& u : flow->u) u = float(int(random() % 9) - 4);
    const std::vector<float> plain = confidence(forward, backward), even = confidence(forward, backward, step, step);
    for (size_t p = 0; p < plain.size(); ++p) EXPECT_GE(even[p], plain[p]);
}

TEST(EvenConfidence, of_what_was_never_seen_is_that_of_forward_and_backward) {
    Image nothing = filled(std::numeric_limits<float>::quiet_NaN());
    const Evenness unseen = evenness_of(nothing, nothing);
    FlowField forward(width, height), backward(width, height);
    std::ranges::fill(forward.u, 2.0f);
    EXPECT_EQ(confidence(forward, backward, unseen, unseen), confidence(forward, backward));
}

// A mask is honoured by methods that know none of their own, too.
TEST(FlowOfUnseenPixels, is_that_of_the_nearest_seen_one_smoothed_as_far_as_that_may_come) {
    Image from = filled(0), to = filled(0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            from.at(x, y) = float(std::sin(0.4 * x) + std::sin(0.31 * y + 0.1 * x));
            to.at(x, y) = float(std::sin(0.4 * (x - 2)) + std::sin(0.31 * y + 0.1 * (x - 2)));
            if (x >= 80) from.at(x, y) = to.at(x, y) = std::numeric_limits<float>::quiet_NaN();
        }
    const FlowField flow = *estimate_flow(from, to, *flow_method("dis-medium"));
    for (int y = 20; y < height - 20; ++y)
        for (int x = 80; x + 1 < width; ++x) {
            const float* const u = &flow.u[size_t(y * width + x)];
            if (x > 83 && x < 90) {
                EXPECT_NEAR(u[0], 2, 0.5);
            }
            if (x > 83) {
                EXPECT_LT(std::abs(u[1] - u[0]), 0.2f) << "no borders beyond the outline";
            }
            if (x > 80 + 2 * (6 * 2.5 + 2)) {
                EXPECT_EQ(u[0], 0) << x << ": twice as far as it comes in six links";
            }
        }
}
