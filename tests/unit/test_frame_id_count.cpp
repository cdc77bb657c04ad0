// SPDX-License-Identifier: MIT
// links: ols_device
#include "device/frame_id_count.hpp"

#include <gtest/gtest.h>

namespace ols {
namespace {

constexpr uint64_t period_ns = 462'963;  // 2160 frames/s

// The n-th frame of a camera that counts as GigE Vision says: 1 to 65535, and 1 again.
CameraStamp nth(uint64_t n, uint64_t time_ns) {
    return {(n - 1) % 65535 + 1, time_ns};
}
CameraStamp nth(uint64_t n) {
    return nth(n, n * period_ns);
}

}  // namespace

TEST(FrameIdCount, goes_on_over_any_number_of_wraps) {
    FrameIdCount count;
    for (uint64_t n = 1; n < 300'000; ++n) ASSERT_EQ(count.unwrap(nth(n)), n);
}

TEST(FrameIdCount, a_gap_is_as_long_as_it_is_also_over_a_wrap) {
    for (const uint64_t lost : {1, 7, 64'000, 65'534, 65'535, 65'536, 200'000}) {
        FrameIdCount count;
        for (uint64_t n = 60'000; n < 61'000; ++n) (void)count.unwrap(nth(n));
        const uint64_t before = count.unwrap(nth(61'000));
        EXPECT_EQ(count.unwrap(nth(61'001 + lost)) - before, lost + 1) << lost;
    }
}

TEST(FrameIdCount, a_pause_of_the_triggers_is_no_gap_be_it_ever_so_long) {
    for (const double pause_s : {0.5, 29.7, 60.0, 91.3, 3600.0}) {
        FrameIdCount count;
        for (uint64_t n = 1; n < 1000; ++n) (void)count.unwrap(nth(n));
        const auto pause_ns = uint64_t(pause_s * 1e9);
        for (uint64_t n = 1000; n < 1010; ++n) EXPECT_EQ(count.unwrap(nth(n, n * period_ns + pause_ns)), n) << pause_s;
    }
}

TEST(FrameIdCount, jitter_of_stamps_and_drift_of_the_clock_do_not_matter) {
    FrameIdCount count;
    uint64_t before = 0;
    for (uint64_t n = 1; n <= 5000; ++n)
        before = count.unwrap(nth(n, n * period_ns * 1'000'020 / 1'000'000 + n * 7919 % 2000));
    EXPECT_EQ(count.unwrap(nth(5000 + 65'535 + 17, (5000 + 65'535 + 17) * period_ns * 1'000'020 / 1'000'000)) - before,
              65'552u);
}

TEST(FrameIdCount, a_late_frame_has_the_id_it_would_have_had) {
    FrameIdCount count;
    for (uint64_t n = 65'530; n < 65'540; ++n) EXPECT_EQ(count.unwrap(nth(n)), n);
    EXPECT_EQ(count.unwrap(nth(65'534)), 65'534u);
    EXPECT_EQ(count.unwrap(nth(65'540)), 65'540u);
}

TEST(FrameIdCount, a_device_that_does_not_skip_zero_wraps_after_it) {
    FrameIdCount count;
    EXPECT_EQ(count.unwrap({0, 0}), 0u);
    for (uint64_t n = 1; n < 70'000; ++n) ASSERT_EQ(count.unwrap({n % 65536, n * period_ns}), n);
}

TEST(FrameIdCount, ids_beyond_sixteen_bits_are_left_as_they_are) {
    FrameIdCount count;
    for (const uint64_t id : {65'535ull, 65'536ull, 65'538ull, 1ull << 40})
        EXPECT_EQ(count.unwrap({id, id * period_ns}), id);
}

}  // namespace ols
