// SPDX-License-Identifier: MIT
// Motion blur against closed forms and against brute force; what it keeps, what breaks it, what it refuses.
// links: ols_relight
#include "relight/motion_blur.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "blur_scene.hpp"
#include "image/compare.hpp"

using namespace ols;
using namespace ols::test;

namespace {

constexpr double fps = 24, pi = std::numbers::pi;

using Path = std::function<std::array<double, 2>(double x, double y, double t)>;

// Flows of a motion given at every place, at these instants.
TargetMotion motion_of(int width, int height, const std::vector<double>& times_s, const Path& moved) {
    TargetMotion motion{times_s, {}};
    for (const double t : times_s) {
        FlowField flow(width, height);
        for (int i = 0; i < width * height; ++i) {
            const auto [u, v] = moved(i % width, i / width, t);
            flow.u[size_t(i)] = float(u), flow.v[size_t(i)] = float(v);
        }
        motion.flows.push_back(std::move(flow));
    }
    return motion;
}

// The whole picture moves by (u, v) pixels a frame time.
TargetMotion translation(int width, int height, double u, double v) {
    return motion_of(width, height, {-1 / fps, 1 / fps}, [=](double, double, double t) {
        return std::array{u * t * fps, v * t * fps};
    });
}

Image impulse(int width, int height, int x, int y) {
    Image image(width, height, 1);
    image.at(x, y) = 1;
    return image;
}

Image noise_image(int width, int height, int channels) {
    Image image(width, height, channels);
    std::mt19937 random(7);
    for (float& value : image.data) value = std::uniform_real_distribution<float>(0, 2)(random);
    return image;
}

double sum_of(const Image& image, int channel) {
    double sum = 0;
    for (size_t i = size_t(channel); i < image.data.size(); i += size_t(image.channels)) sum += double(image.data[i]);
    return sum;
}

Image blurred(const Image& sharp, const TargetMotion& motion, const MotionBlurOptions& options) {
    const auto result = motion_blurred(sharp, motion, fps, options);
    EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
    return result->image;
}

// Mean of hat(x - s) over s in [a, b]: an impulse interpolated linearly and drawn along a line.
double drawn_impulse(double x, double a, double b) {
    const auto integral = [](double z) {
        z = std::clamp(z, -1.0, 1.0);
        return z < 0 ? (1 + z) * (1 + z) / 2 : 1 - (1 - z) * (1 - z) / 2;
    };
    return (integral(x - a) - integral(x - b)) / (b - a);
}

}  // namespace

// A shutter of 180 degrees sees half of the motion of a frame, centred. The midpoint rule with steps of 0.05 pixels is off by
// less than step^2 / 8 of a hat's change of slope, 2 a pixel, at each of its three kinks and over the path's length.
TEST(MotionBlur, of_a_translation_is_a_box_along_its_line) {
    const Image sharp = impulse(48, 9, 24, 4);
    const Image result = blurred(sharp, translation(48, 9, 15, 0), {.step_px = 0.05});
    for (int x = 0; x < 48; ++x) {
        EXPECT_NEAR(result.at(x, 4), drawn_impulse(x - 24, -3.75, 3.75), 0.002) << x;
        EXPECT_NEAR(result.at(x, 3), 0, 1e-6);
    }
}

TEST(MotionBlur, follows_the_pieces_of_a_path_that_turns) {
    const auto bent = motion_of(40, 40, {-1 / fps, 1 / fps}, [](double, double, double t) {
        return t < 0 ? std::array{8 * t * fps, 0.0} : std::array{0.0, 12 * t * fps};
    });
    const Image result = blurred(impulse(40, 40, 20, 20), bent, {.shutter_deg = 360, .step_px = 0.05});
    for (int k = 2; k <= 8; ++k) {
        EXPECT_NEAR(result.at(20 - k, 20), drawn_impulse(-k, -4, 0) / 2, 0.002) << k;
        EXPECT_NEAR(result.at(20, 20 + k), drawn_impulse(k, 0, 6) / 2, 0.002) << k;
    }
    EXPECT_NEAR(sum_of(result, 0), 1, 1e-5);
}

// cos(w x) under a box of length L is sinc(w L / 2) cos(w x). Bilinear interpolation is off by w^2 / 8 at most.
TEST(MotionBlur, damps_a_wave_by_the_sinc_of_its_phase) {
    const double w = 0.3, length_px = 14;
    Image sharp(120, 5, 1);
    for (int i = 0; i < 120 * 5; ++i) sharp.data[size_t(i)] = float(std::cos(w * (i % 120)));
    const Image result = blurred(sharp, translation(120, 5, 2 * length_px, 0), {.step_px = 0.25});
    const double damping = std::sin(w * length_px / 2) / (w * length_px / 2);
    for (int x = 8; x < 112; ++x) EXPECT_NEAR(result.at(x, 2), damping * std::cos(w * x), w * w / 8) << x;
}

// Six spokes turning by 24 degrees blur to sinc(6 x 12 degrees) of their contrast; rings stay. Where a knot comes every 3 degrees,
// chords miss the circle by less than 30 px x (1.5 degrees)^2 / 2 = 0.011 px.
TEST(MotionBlur, of_a_turning_disc_damps_spokes_and_keeps_rings) {
    constexpr int size = 71;
    constexpr double middle = 35, turn = 24 * pi / 180;
    std::vector<double> times_s;
    for (int k = -4; k <= 4; ++k)
        if (k != 0) times_s.push_back(k / 8.0 / fps);
    const auto turning = motion_of(size, size, times_s, [](double x, double y, double t) {
        const double a = turn * t * fps, dx = x - middle, dy = y - middle;
        return std::array{(std::cos(a) - 1) * dx - std::sin(a) * dy, std::sin(a) * dx + (std::cos(a) - 1) * dy};
    });
    Image sharp(size, size, 2);
    const auto spokes = [](double x, double y) { return std::cos(6 * std::atan2(y - middle, x - middle)); };
    const auto rings = [](double x, double y) { return std::cos(0.3 * std::hypot(x - middle, y - middle)); };
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) sharp.at(x, y, 0) = float(spokes(x, y)), sharp.at(x, y, 1) = float(rings(x, y));
    const Image result = blurred(sharp, turning, {.shutter_deg = 360, .step_px = 0.5});
    const double damping = std::sin(6 * turn / 2) / (6 * turn / 2);
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) {
            const double r = std::hypot(x - middle, y - middle);
            if (r < 15 || r > 30) continue;
            // Bilinear interpolation: an eighth of the sum of the second derivatives in x and y, at most.
            ASSERT_NEAR(result.at(x, y, 0), damping * spokes(x, y), 36 / (r * r) / 8 + 0.011 * 6 / r) << x << "," << y;
            ASSERT_NEAR(result.at(x, y, 1), rings(x, y), 0.3 * 0.3 / 8 * (1 + 1 / (0.3 * r)) + 0.011 * 0.3);
        }
}

TEST(MotionBlur, without_motion_keeps_every_bit_and_beside_motion_too) {
    const Image sharp = noise_image(70, 50, 4);
    EXPECT_EQ(blurred(sharp, translation(70, 50, 0, 0), {}).data, sharp.data);
    auto moving = translation(70, 50, 0, 0);
    for (auto& flow : moving.flows)
        for (int y = 20; y < 30; ++y) flow.u[size_t(y * 70 + 35)] = 6;
    const Image result = blurred(sharp, moving, {});
    EXPECT_NE(result.data, sharp.data);
    for (int y = 0; y < 50; ++y)
        for (int x = 0; x < 70; ++x)
            if (x < 30 || x > 42 || y < 18 || y > 31) {
                ASSERT_EQ(result.at(x, y, 3), sharp.at(x, y, 3)) << x << "," << y;
            }
}

TEST(MotionBlur, keeps_white_white_whatever_moves) {
    Image white(40, 30, 3);
    white.data.assign(white.data.size(), 1);
    std::mt19937 random(3);
    std::normal_distribution<double> step(0, 6);
    const auto wild = motion_of(40, 30, {-0.03, 0.03}, [&](double, double, double) {
        return std::array{step(random), step(random)};
    });
    EXPECT_EQ(blurred(white, wild, {.shutter_deg = 360}).data, white.data);
    const auto zoom = motion_of(40, 30, {-0.03, 0.03}, [](double x, double y, double t) {
        return std::array{8 * t * (x - 20), 8 * t * (y - 15)};
    });
    EXPECT_EQ(blurred(white, zoom, {.shutter_deg = 360}).data, white.data);
}

// A pixel of the disc's border is seen as a square of one pixel; over a path of many pixels that evens out to 1 / (2 path) of
// the border's share in the sum, here 2 / radius.
TEST(MotionBlur, keeps_the_light_of_what_does_not_leave_the_picture) {
    const DiscScene scene;
    const Image sharp = scene.at(0), result = blurred(sharp, scene.motion(2), {.step_px = 0.25});
    for (const int channel : {1, 2})
        EXPECT_NEAR(sum_of(result, channel) / sum_of(sharp, channel), 1, 2 / scene.radius / (2 * 12)) << channel;
    Image inside(60, 40, 2);
    for (int y = 15; y < 25; ++y)
        for (int x = 20; x < 40; ++x) inside.at(x, y, 0) = float(1 + (x * y) % 3), inside.at(x, y, 1) = 1;
    const Image moved = blurred(inside, translation(60, 40, 17.3, -9.1), {});
    for (const int channel : {0, 1}) EXPECT_NEAR(sum_of(moved, channel) / sum_of(inside, channel), 1, 1e-6);
}

// An even wall, so that what the disc uncovers is known. What remains is the disc's border, which a sharp picture knows to half a
// pixel only: the border's pixels, of some path length, are off by half a pixel of that path.
TEST(MotionBlur, of_a_disc_before_a_wall_is_what_brute_force_gives) {
    DiscScene scene;
    scene.wall_detail = 0;
    const double half_s = 0.25 / fps;
    const Image truth = scene.brute_force(-half_s, half_s, 400), sharp = scene.at(0);
    const auto difference = image_difference(blurred(sharp, scene.motion(3), {.step_px = 0.25}), truth);
    const auto without = image_difference(sharp, truth);
    EXPECT_LT(difference.rms, without.rms / 10);
}

TEST(MotionBlur, comes_nearer_to_brute_force_with_smaller_steps) {
    DiscScene scene;
    scene.wall_detail = 0;
    const Image truth = scene.brute_force(-0.25 / fps, 0.25 / fps, 400), sharp = scene.at(0);
    double last = std::numeric_limits<double>::infinity();
    for (const double step_px : {8.0, 4.0, 2.0, 1.0}) {
        const double rms = image_difference(blurred(sharp, scene.motion(3), {.step_px = step_px}), truth).rms;
        EXPECT_LT(rms, last) << step_px;
        last = rms;
    }
}

// What breaks it: behind the disc the wall's detail is not in the picture, and the nearest of it stands in for the rest.
TEST(MotionBlur, does_not_know_the_detail_of_what_is_uncovered) {
    const auto rms_error = [&](double wall_detail) {
        DiscScene scene;
        scene.wall_detail = wall_detail;
        const Image truth = scene.brute_force(-0.25 / fps, 0.25 / fps, 200);
        return image_difference(blurred(scene.at(0), scene.motion(3), {.step_px = 0.5}), truth).rms;
    };
    EXPECT_GT(rms_error(4), 2 * rms_error(0));
}

// What breaks it: a still thing in front of a moving one. What moves farther is taken to be in front.
TEST(MotionBlur, takes_what_moves_farther_to_be_in_front) {
    Image sharp(60, 20, 1);
    auto motion = translation(60, 20, 0, 0);
    for (int y = 0; y < 20; ++y)
        for (int x = 20; x < 30; ++x) {
            sharp.at(x, y) = 1;
            for (size_t k = 0; k < 2; ++k) motion.flows[k].u[size_t(y * 60 + x)] = k == 0 ? -20.0f : 20.0f;
        }
    const Image result = blurred(sharp, motion, {.step_px = 0.1});
    for (int x = 31; x < 34; ++x) EXPECT_NEAR(result.at(x, 10), (34.5 - x) / 10, 0.06) << x;
    EXPECT_EQ(result.at(45, 10), 0);
}

TEST(MotionBlur, of_what_leaves_the_picture_loses_its_share_and_the_border_shows_what_was_seen) {
    const double length_px = 20;
    const Image result = blurred(impulse(40, 5, 36, 2), translation(40, 5, 2 * length_px, 0), {.step_px = 0.1});
    // From x = 26 on each pixel sees it for 1 of 20 parts of the time, and the last ones see nothing at all while the picture's right
    // border, at 39.5 + moved, is left of them.
    for (int x = 28; x < 40; ++x) {
        const double seen = std::min(1.0, (49.5 - x) / length_px);
        EXPECT_NEAR(result.at(x, 2), 1 / length_px / seen, 1e-3) << x;
    }
    Image ramp(40, 5, 1);
    for (int i = 0; i < 40 * 5; ++i) ramp.data[size_t(i)] = float(i % 40);
    const Image moved = blurred(ramp, translation(40, 5, 2 * length_px, 0), {.step_px = 0.1});
    // Column 0 sees the picture while that is moved by -10 .. 0.5, and then columns 10 .. 0.
    EXPECT_NEAR(moved.at(0, 2), 50.0 / 10.5, 0.1);
    EXPECT_NEAR(moved.at(20, 2), 20, 1e-3);
}

TEST(MotionBlur, an_exposure_off_centre_shows_the_subject_where_it_is_then_and_counts_what_it_never_saw) {
    const auto result =
        motion_blurred(impulse(60, 5, 20, 2), translation(60, 5, 24, 0), fps, {.shutter_deg = 90, .phase_deg = 180});
    ASSERT_TRUE(result.ok());
    // The middle is half a frame after the target: 12 pixels on, and a quarter of a frame long.
    for (int x = 30; x < 35; ++x) EXPECT_NEAR(result->image.at(x, 2), drawn_impulse(x - 32, -3, 3), 0.02) << x;
    EXPECT_EQ(result->image.at(20, 2), 0);
    EXPECT_EQ(result->unseen_pixels, 9u * 5);  // moved by 9 to 15: columns 0 to 8 are left by the sheet's edge, at 8.5
}

TEST(MotionBlur, goes_on_at_the_same_speed_beyond_the_known_instants_and_says_by_how_much) {
    const Image sharp = impulse(48, 9, 24, 4);
    TargetMotion one = translation(48, 9, 15, 0);
    one.times_s = {0.25 / fps};
    for (float& u : one.flows[1].u) u = 3.75f;
    one.flows.erase(one.flows.begin());
    const auto result = motion_blurred(sharp, one, fps, {.shutter_deg = 360, .step_px = 0.05});
    ASSERT_TRUE(result.ok());
    EXPECT_NEAR(result->extrapolated_s, 0.5 / fps, 1e-12);
    for (int x = 0; x < 48; ++x) EXPECT_NEAR(result->image.at(x, 4), drawn_impulse(x - 24, -7.5, 7.5), 0.002) << x;
    EXPECT_EQ(motion_blurred(sharp, translation(48, 9, 15, 0), fps)->extrapolated_s, 0);
}

TEST(MotionBlur, is_the_same_bits_for_any_number_of_threads) {
    const DiscScene scene;
    const Image one = blurred(scene.at(0), scene.motion(2), {.threads = 1});
    for (const int threads : {2, 5})
        EXPECT_EQ(blurred(scene.at(0), scene.motion(2), {.threads = threads}).data, one.data);
}

TEST(MotionBlur, refuses_what_makes_no_sense_and_says_what_to_do) {
    const Image sharp = impulse(20, 10, 3, 3);
    const auto refusal = [&](const Image& image, const TargetMotion& motion, MotionBlurOptions options,
                             double rate = fps) {
        const auto result = motion_blurred(image, motion, rate, options);
        return result.ok() ? "done" : result.error().message;
    };
    const auto good = translation(20, 10, 4, 0);
    EXPECT_EQ(refusal(sharp, good, {.shutter_deg = 720}), "done");
    for (const double shutter : {-1.0, 721.0, std::nan("")})
        EXPECT_NE(refusal(sharp, good, {.shutter_deg = shutter}).find("0 (no blur) to 720"), std::string::npos);
    EXPECT_NE(refusal(sharp, good, {.phase_deg = 400}).find("phase"), std::string::npos);
    EXPECT_NE(refusal(sharp, good, {.step_px = 0}).find("0.01 to 16"), std::string::npos);
    EXPECT_NE(refusal(sharp, good, {}, 0).find("frame rate"), std::string::npos);
    EXPECT_NE(refusal(sharp, translation(10, 20, 4, 0), {}).find("10 x 20"), std::string::npos);
    EXPECT_NE(refusal(sharp, {}, {}).find("no motion"), std::string::npos);
    EXPECT_NE(refusal(sharp, translation(20, 10, 400, 0), {}).find("farther than the picture"), std::string::npos);
    auto spoilt = good;
    spoilt.flows[1].u[25] = std::numeric_limits<float>::quiet_NaN();
    EXPECT_NE(refusal(sharp, spoilt, {}).find("not finite at pixel 5, 1"), std::string::npos);
    Image bright = sharp;
    bright.data[7] = std::numeric_limits<float>::infinity();
    EXPECT_NE(refusal(bright, good, {}).find("1 samples that are not finite"), std::string::npos);
}
