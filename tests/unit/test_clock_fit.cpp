// SPDX-License-Identifier: MIT
// Clocks against lines and against the textbook's two-pass least squares, in long double.
// links: ols_record
#include "record/clock_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

using namespace ols;

TEST(ClockFit, recovers_a_line_over_an_hour_to_its_rounding) {
    constexpr double drift_ppm = -37.5;
    constexpr uint64_t offset_ns = 7'000'000'000'123, first_tick = 123'456'789;
    ClockFit fit;
    for (uint64_t n = 0; n < 2160 * 60; ++n) {
        const uint64_t ticks = first_tick + n * 57'870 * 60;  // every minute's worth of slots
        fit.add(ticks, offset_ns + ticks * 8 + uint64_t(int64_t(std::llround(double(ticks) * 8 * drift_ppm * 1e-6))));
    }
    const auto relation = fit.relation();
    ASSERT_TRUE(relation);
    EXPECT_NEAR(relation->drift_ppm, drift_ppm, 1e-9);
    EXPECT_NEAR(double(relation->offset_ns - int64_t(offset_ns)), 0, 2);
    EXPECT_NEAR(relation->scatter_ns, 1 / std::sqrt(12), 0.05) << "whole nanoseconds";
}

TEST(ClockFit, scatter_and_error_are_those_of_two_passes) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> jitter(0, 250);
    std::vector<std::pair<uint64_t, uint64_t>> samples;
    ClockFit fit;
    for (uint64_t n = 0; n < 5000; ++n) {
        samples.emplace_back(1000 + n * 57'870,
                             1'000'000'000 + n * 462'960 + uint64_t(std::llround(50'000 + jitter(random))));
        fit.add(samples.back().first, samples.back().second);
    }
    long double mean_x = 0, mean_y = 0;
    for (const auto& [ticks, ns] : samples) mean_x += 8.0L * ticks / 5000, mean_y += (long double)(ns) / 5000;
    long double xx = 0, xy = 0, rest = 0;
    for (const auto& [ticks, ns] : samples)
        xx += std::pow(8.0L * ticks - mean_x, 2), xy += (8.0L * ticks - mean_x) * (ns - mean_y);
    const long double slope = xy / xx;
    for (const auto& [ticks, ns] : samples) rest += std::pow(ns - mean_y - slope * (8.0L * ticks - mean_x), 2);
    const auto relation = fit.relation();
    ASSERT_TRUE(relation);
    EXPECT_NEAR(relation->drift_ppm, double(slope - 1) * 1e6, 1e-6);
    EXPECT_NEAR(relation->scatter_ns, double(std::sqrt(rest / 4998)), 1e-3);
    EXPECT_NEAR(relation->drift_error_ppm, double(std::sqrt(rest / 4998 / xx)) * 1e6, 1e-9);
    EXPECT_LT(std::abs(relation->drift_ppm), 5 * relation->drift_error_ppm) << "the truth is 0";
}

TEST(ClockFit, says_nothing_of_what_it_cannot_know) {
    ClockFit fit;
    EXPECT_FALSE(fit.relation());
    fit.add(1, 10), fit.add(2, 20);
    EXPECT_FALSE(fit.relation()) << "two samples have no scatter";
    ClockFit still;
    for (int n = 0; n < 9; ++n) still.add(5, 40);
    EXPECT_FALSE(still.relation()) << "a clock that stands";
}

TEST(HostClock, the_quickest_exchanges_rule_and_bound_the_error) {
    std::mt19937_64 random(9);
    std::exponential_distribution<double> wait(1 /
                                               3e6);  // of the way there and of the way back, mostly of milliseconds
    HostClock clock;
    constexpr double offset_ns = 5e9, drift = 12e-6;
    double now_ns = offset_ns + 3e6, quickest_ns = 1e18;
    for (int n = 0; n < 20'000; ++n) {
        const double there = 20e3 + wait(random), back = 20e3 + wait(random);
        const double board_ns = (now_ns + there - offset_ns) / (1 + drift);
        clock.add(uint64_t(now_ns), uint64_t(now_ns + there + back), uint64_t(board_ns / 8));
        quickest_ns = std::min(quickest_ns, there + back);
        now_ns += there + back + 1e6;
    }
    const auto relation = clock.relation();
    ASSERT_TRUE(relation);
    EXPECT_LE(std::abs(double(relation->offset_ns) - offset_ns), relation->bound_ns);
    EXPECT_GE(relation->bound_ns, quickest_ns / 2 - 1);
    EXPECT_LT(relation->bound_ns, 3e6) << "not what most exchanges would say";
    EXPECT_NEAR(relation->drift_ppm, 12, 5 * relation->drift_error_ppm);
}
