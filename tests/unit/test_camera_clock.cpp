// SPDX-License-Identifier: MIT
// links: ols_device
#include "device/camera_clock.hpp"

#include <gtest/gtest.h>

namespace ols {
namespace {

constexpr uint64_t second = 1'000'000'000;

}  // namespace

TEST(CameraClock, is_a_delivery_behind_the_camera_and_goes_on) {
    CameraClock clock;
    clock.start(50 * second, 1000 * second);
    for (uint64_t passed = 0; passed <= 100; ++passed) {
        const uint64_t host_ns = 1000 * second + passed * second / 5;
        const uint64_t camera_ns = 50 * second + passed * second / 5;
        if (passed > 0) clock.asked(camera_ns, host_ns);
        const uint64_t watermark_ns = clock.watermark_ns(host_ns);
        EXPECT_LE(watermark_ns, camera_ns - 0.99 * second);
        EXPECT_GE(watermark_ns, camera_ns - 1.01 * second);
        EXPECT_GT(clock.watermark_ns(host_ns + 1000), watermark_ns);
    }
}

// As a virtual stage that takes ten seconds for one, and stops in the end.
TEST(CameraClock, keeps_to_a_time_that_goes_slower_than_the_walls) {
    CameraClock clock;
    clock.start(5 * second, 0);
    for (uint64_t tenths = 2; tenths < 200; tenths += 2) {
        const uint64_t camera_ns = 5 * second + tenths * second / 100;
        clock.asked(camera_ns, tenths * second / 10);
        EXPECT_LE(clock.watermark_ns(tenths * second / 10 + second / 5), camera_ns) << "the next answer is due";
    }
    for (uint64_t tenths = 200; tenths < 300; tenths += 2) clock.asked(7 * second, tenths * second / 10);
    EXPECT_LE(clock.watermark_ns(40 * second), 7 * second);
}

TEST(CameraClock, without_being_asked_follows_frames_and_before_them_only_that_it_runs) {
    CameraClock clock;
    clock.start(std::nullopt, 100 * second);
    EXPECT_EQ(clock.watermark_ns(100 * second), 0u);
    EXPECT_LE(clock.watermark_ns(110 * second), 9 * second) << "it was at least 0";
    EXPECT_GE(clock.watermark_ns(110 * second), 8 * second);
    clock.frame_came(77 * second, 110 * second);
    EXPECT_LE(clock.watermark_ns(111 * second), 77 * second);
    EXPECT_GE(clock.watermark_ns(120 * second), 85 * second) << "also when no more come";
}

TEST(CameraClock, a_camera_whose_frames_take_longer_is_given_twice_that) {
    CameraClock clock;
    clock.start(10 * second, 10 * second);
    clock.asked(20 * second, 20 * second);
    clock.frame_came(17 * second, 20 * second);
    EXPECT_LE(clock.watermark_ns(30 * second), 24 * second + second / 10);
}

TEST(CameraClock, never_goes_back_and_begins_anew_with_a_start) {
    CameraClock clock;
    clock.start(100 * second, 0);
    const uint64_t before_ns = clock.watermark_ns(10 * second);
    clock.asked(3 * second, 11 * second);
    EXPECT_EQ(clock.watermark_ns(12 * second), before_ns);
    clock.start(3 * second, 12 * second);
    EXPECT_LT(clock.watermark_ns(13 * second), 4 * second);
}

}  // namespace ols
