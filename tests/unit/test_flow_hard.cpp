// SPDX-License-Identifier: MIT
// Flow from images that say little, or wrong things: always finite, and what is not known comes from the surroundings.
// links: ols_flow
#include <gtest/gtest.h>

#include <limits>

#include "flow/flow.hpp"
#include "flow_scenes.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

constexpr int width = 224, height = 160;

Motion shift(double x, double y) {
    return similarity(0, 1, x, y, 0, 0);
}

FlowScene moving_plane(double x, double y) {
    return plane_scene("plane", width, height, value_noise(61, 6), shift(x, y));
}

double longest(const FlowField& flow) {
    double most = 0;
    for (size_t p = 0; p < flow.size(); ++p) {
        if (!std::isfinite(flow.u[p]) || !std::isfinite(flow.v[p])) return std::numeric_limits<double>::infinity();
        most = std::max(most, std::hypot(double(flow.u[p]), double(flow.v[p])));
    }
    return most;
}

}  // namespace

class HardFlow : public testing::TestWithParam<std::string> {
  protected:
    FlowField estimate(const Image& from, const Image& to,
                       float saturation = std::numeric_limits<float>::infinity()) const {
        FlowOptions options = *flow_method(GetParam());
        options.saturation = saturation;
        Result<FlowField> flow = estimate_flow(from, to, options);
        EXPECT_TRUE(flow);
        return *flow;
    }
    bool ours() const { return !GetParam().starts_with("dis"); }
};

TEST_P(HardFlow, is_zero_where_all_is_black_or_even) {
    Image black(width, height, 1), grey = black;
    std::fill(grey.data.begin(), grey.data.end(), 700.0f);
    EXPECT_EQ(longest(estimate(black, black)), 0);
    EXPECT_EQ(longest(estimate(grey, grey)), 0);
    EXPECT_EQ(longest(estimate(black, grey)), 0);
}

TEST_P(HardFlow, is_zero_where_nothing_is_seen) {
    Image nothing(width, height, 1);
    std::fill(nothing.data.begin(), nothing.data.end(), std::numeric_limits<float>::quiet_NaN());
    EXPECT_EQ(longest(estimate(nothing, nothing)), 0);
    EXPECT_EQ(longest(estimate(moving_plane(0, 0).from, nothing)), 0);
}

TEST_P(HardFlow, takes_from_the_surroundings_what_a_textureless_patch_does_not_say) {
    const Texture plain_patch = [noise = value_noise(62, 6)](double x, double y) {
        const double edge = std::clamp((std::hypot(x - 112, y - 80) - 20) / 8, 0.0, 1.0);
        return 0.5 + edge * (noise(x, y) - 0.5);
    };
    const FlowScene scene = plane_scene("patch", width, height, plain_patch, shift(3, -1));
    const FlowField flow = estimate(scene.from, scene.to);
    EXPECT_NEAR(flow.u[80 * width + 112], 3, 0.4);
    EXPECT_NEAR(flow.v[80 * width + 112], -1, 0.4);
    EXPECT_LT(longest(flow), 6);
}

TEST_P(HardFlow, stays_small_between_pictures_of_nothing_but_noise) {
    Image from(width, height, 1), to = from;
    add_noise(from, 1);
    add_noise(to, 2);
    const FlowField flow = estimate(from, to);
    ASSERT_TRUE(std::isfinite(longest(flow)));
    double sum = 0;
    for (size_t p = 0; p < flow.size(); ++p) sum += std::hypot(double(flow.u[p]), double(flow.v[p]));
    if (ours()) {
        EXPECT_LT(sum / double(flow.size()), 4);
    }
}

TEST_P(HardFlow, follows_through_the_cameras_noise) {
    const FlowScene scene = noisy(moving_plane(2.3, 1.1));
    EXPECT_LT(endpoint_error(estimate(scene.from, scene.to), scene), 0.25);
}

TEST_P(HardFlow, does_not_follow_the_shading) {
    // Brightness falls to the right by a half, and the fall does not move with the texture.
    FlowScene scene = moving_plane(3, 1);
    for (Image* image : {&scene.from, &scene.to})
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) image->at(x, y) *= float(1 - 0.5 * x / width);
    EXPECT_LT(endpoint_error(estimate(scene.from, scene.to), scene), ours() ? 0.15 : 0.3);
}

TEST_P(HardFlow, reads_nothing_from_saturated_pixels) {
    // A lamp's reflection that stands still, saturated, before texture that moves.
    FlowScene scene = moving_plane(3, 1);
    for (Image* image : {&scene.from, &scene.to})
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                if (std::hypot(x - 112, y - 80) < 12) image->at(x, y) = 4095;
    const FlowField told = estimate(scene.from, scene.to, 4095);
    const size_t centre = 80 * width + 112;
    if (ours()) {
        EXPECT_NEAR(told.u[centre], 3, 0.5);
        EXPECT_LT(endpoint_error(told, scene), 0.2);
        const FlowField untold = estimate(scene.from, scene.to);
        EXPECT_GT(std::abs(untold.u[centre] - 3), 1);  // the reflection's rim says that it stands still
    }
    EXPECT_LT(longest(told), 10);
}

// A disc of texture that moves before nothing: what lies near goes along, what it does not come to stands still.
TEST_P(HardFlow, leaves_what_is_far_from_all_that_is_seen) {
    FlowScene scene = moving_plane(2, 0);
    for (Image* image : {&scene.from, &scene.to})
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                if (std::hypot(x - 60, y - 80) > 30) image->at(x, y) = std::numeric_limits<float>::quiet_NaN();
    const FlowField flow = estimate(scene.from, scene.to);
    const auto u = [&](int x) { return flow.u[size_t(80 * width + x)]; };
    EXPECT_NEAR(u(60), 2, 0.5);
    EXPECT_NEAR(u(60 + 34), 2, 0.5) << "4 pixels from the disc";
    if (!ours()) {
        EXPECT_EQ(u(60 + 30 + 40), 0) << "twice as far as it comes in six links";
    }
}

TEST_P(HardFlow, bridges_pixels_that_are_no_numbers) {
    FlowScene scene = moving_plane(2, 2);
    for (size_t p = 0; p < scene.from.data.size(); p += 97) {
        scene.from.data[p] = std::numeric_limits<float>::quiet_NaN();
        scene.to.data[p + 3] = std::numeric_limits<float>::infinity();
    }
    EXPECT_LT(endpoint_error(estimate(scene.from, scene.to), scene), ours() ? 0.1 : 0.3);
}

TEST_P(HardFlow, stays_bounded_when_a_subject_enters_or_leaves) {
    const FlowScene ball = ball_scene("ball", width, height, value_noise(63, 5), 1);
    const Image empty(width, height, 1);
    for (const auto& [from, to] : {std::pair(empty, ball.to), std::pair(ball.from, empty)})
        EXPECT_LT(longest(estimate(from, to)), std::hypot(width, height));
}

TEST_P(HardFlow, a_subject_that_enters_does_not_disturb_one_that_was_there) {
    FlowScene scene = plane_scene("entering", width, height, value_noise(64, 6), shift(2, 1));
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (x >= 150) scene.from.at(x, y) = 0, scene.scored[size_t(y) * width + size_t(x)] = 0;
            if (x >= 200) scene.to.at(x, y) = 0;
            if (x >= 130) scene.scored[size_t(y) * width + size_t(x)] = 0;
        }
    EXPECT_LT(endpoint_error(estimate(scene.from, scene.to), scene), ours() ? 0.1 : 0.3);
}

TEST_P(HardFlow, is_off_by_whole_periods_at_worst_in_a_periodic_texture) {
    constexpr double period = 16;  // pixels
    const Texture waves = [](double x, double y) {
        return 0.5 + 0.25 * (std::sin(x * 2 * M_PI / period) + std::sin(y * 2 * M_PI / period));
    };
    for (const double jump : {3.0, 6.0, 11.0}) {
        const FlowScene scene = plane_scene("periodic", width, height, waves, shift(jump, 0));
        const FlowField found = estimate(scene.from, scene.to);
        EXPECT_NEAR(std::remainder(found.u[80 * width + 112] - jump, period), 0, 0.5) << jump;
        EXPECT_LT(longest(found), 4 * period) << jump;
    }
}

TEST_P(HardFlow, works_at_odd_and_smallest_sizes) {
    for (const auto& [w, h] : {std::pair(16, 16), std::pair(17, 33), std::pair(101, 16), std::pair(61, 47)}) {
        const FlowScene scene = plane_scene("odd", w, h, value_noise(65, 5), shift(0.6, 0.3));
        EXPECT_LT(longest(estimate(scene.from, scene.to)), 3) << w << " x " << h;
    }
}

INSTANTIATE_TEST_SUITE_P(Methods, HardFlow, testing::Values("dis-fast", "dis-medium", "brox-half", "brox", "robust"),
                         [](const auto& info) {
                             std::string name = info.param;
                             std::replace(name.begin(), name.end(), '-', '_');
                             return name;
                         });
