// SPDX-License-Identifier: MIT
// The machinery of benchmarks: medians, ratios within a round, and the memory of a run.
// links: ols_bench
#include <gtest/gtest.h>

#include <cstring>
#include <memory>

#include "bench.hpp"

using namespace ols;

TEST(Bench, times_are_medians_and_the_peer_has_ratio_1) {
    const auto timings = compare_times({{30, 10, 20}, {5, 4, 6}}, 0);
    EXPECT_EQ(timings[0].ms_median, 20);
    EXPECT_EQ(timings[0].ratio_to_peer, 1);
    EXPECT_EQ(timings[1].ms_median, 5);
}

TEST(Bench, the_median_of_an_even_number_of_rounds_is_the_mean_of_the_middle_two) {
    EXPECT_EQ(compare_times({{1, 9, 4, 2}}, 0)[0].ms_median, 3);
}

// A machine that is twice as slow in some rounds slows both: what is compared is a round, not a median with another.
TEST(Bench, a_slow_stretch_of_the_machine_leaves_the_ratio_as_it_is) {
    EXPECT_EQ(compare_times({{10, 20, 20, 20, 10}, {5, 10, 10, 10, 5}}, 0)[1].ratio_to_peer, 2);
    EXPECT_EQ(compare_times({{10, 20, 10}, {5, 10, 5}}, 1)[0].ratio_to_peer, 0.5);
}

TEST(Bench, memory_is_what_a_run_touches_at_its_peak) {
    constexpr size_t megabytes = size_t(1) << 20;
    const auto bytes = peak_bytes_of([] {
        for (int twice = 0; twice < 2; ++twice) {
            const std::unique_ptr<char[]> block(new char[64 * megabytes]);
            std::memset(block.get(), 1, 64 * megabytes);
        }
    });
    if (!bytes) GTEST_SKIP() << "this kernel does not reset the peak of resident memory";
    EXPECT_GE(*bytes, 63 * megabytes);
    EXPECT_LE(*bytes, 200 * megabytes);  // the sanitizer keeps freed blocks for a while and shadows an eighth
}
