// SPDX-License-Identifier: MIT
// Grey levels at the LED against closed forms: what each pulse loses, and how many pulses each level has; and the timing
// against the firmware's own.
// links: ols_stage ols_firmware
#include "stage/lamp_response.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numeric>

#include "sequence.h"

using namespace ols;

namespace {

constexpr sequence_board as_built{176, 1, {171, 750}};

double worst(const std::vector<double>& errors) {
    double largest = 0;
    for (const double error : errors) largest = std::max(largest, std::abs(error));
    return largest;
}

}  // namespace

TEST(LampResponse, a_lamp_that_follows_at_once_is_linear_to_the_tick) {
    const auto light = grey_light_ticks({}, {8, 200});
    for (size_t level = 0; level < 256; ++level) EXPECT_DOUBLE_EQ(light[level], 200.0 * double(level));
    EXPECT_EQ(worst(grey_errors_levels({}, {8, 200})), 0);
    EXPECT_EQ(least_unit_ticks({}, {}), 8u) << "the board's own limit";
}

TEST(LampResponse, a_single_pulse_loses_what_the_integral_of_an_exponential_says) {
    // One plane lit: on for T after 0, integral T - tau_r (1 - e^(-T/tau_r)) + tau_f (1 - e^(-T/tau_r)).
    const LampResponse lamp{0.1, 0.04, 0.5, 0.2};
    const double rise = 0.5 * 125 / std::log(9.0), fall = 0.2 * 125 / std::log(9.0);
    const auto light = grey_light_ticks(lamp, {8, 200});
    for (int plane = 0; plane < 8; ++plane) {
        const double lit = 200.0 * (1 << plane) - 0.06 * 125;
        EXPECT_NEAR(light[1u << plane], lit - (rise - fall) * (1 - std::exp(-lit / rise)), 1e-9) << plane;
    }
}

TEST(LampResponse, ten_to_ninety_percent_takes_the_time_stated) {
    // Light at the end of a pulse, by the difference quotient of the integral over its length.
    const LampResponse lamp{0, 0, 2.0, 1e-6};
    const auto light_at = [&](double ticks) {
        const auto until = [&](double end) { return grey_light_ticks(lamp, {2, end, 1e9})[1]; };
        return (until(ticks + 1e-3) - until(ticks - 1e-3)) / 2e-3;
    };
    const double constant = 2.0 * 125 / std::log(9.0);
    const double at_10 = -constant * std::log(0.9), at_90 = -constant * std::log(0.1);
    EXPECT_NEAR((at_90 - at_10) / 125, 2.0, 1e-12);
    EXPECT_NEAR(light_at(at_10), 0.1, 1e-3);
    EXPECT_NEAR(light_at(at_90), 0.9, 1e-3);
}

TEST(LampResponse, a_delay_costs_each_pulse_the_same_so_the_error_counts_the_bits_of_a_level) {
    // L(v) = v u - c bits(v), so the error is (8 v / 255 - bits(v)) c u / (u - 8 c / 255), largest at 31 and at 224.
    const double lost = 20;
    const LampResponse lamp{lost / 125, 0, 0, 0};
    const auto errors = grey_errors_levels(lamp, {8, 200});
    for (unsigned level = 0; level < 256; ++level) {
        const double expected = (8 * level / 255.0 - std::popcount(level)) * lost / (200 - 8 * lost / 255);
        EXPECT_NEAR(errors[level], expected, 1e-9) << level;
    }
    EXPECT_NEAR(worst(errors), std::abs(errors[31]), 1e-12);
    // Half a level: u - 8 c / 255 = 2 c (5 - 8 * 31 / 255).
    const double least = 2 * lost * (5 - 8 * 31 / 255.0) + 8 * lost / 255;
    EXPECT_EQ(least_unit_ticks(lamp, {}), uint32_t(std::ceil(least)));
}

TEST(LampResponse, as_slow_to_fall_as_to_rise_loses_next_to_nothing) {
    const LampResponse even{0, 0, 0.3, 0.3}, uneven{0, 0, 0.3, 0.1};
    EXPECT_LT(worst(grey_errors_levels(even, {8, 200})), 1e-6);
    EXPECT_GT(worst(grey_errors_levels(uneven, {8, 200})), 0.1);
}

TEST(LampResponse, half_a_level_is_reached_at_the_least_unit_and_not_one_tick_below) {
    for (const LampResponse lamp :
         {LampResponse{0.05, 0.03, 0.2, 0.1}, {0, 0.2, 0.1, 0.5}, {0.3, 0.1, 3, 1}, {2, 1, 1, 1}}) {
        const uint32_t unit = least_unit_ticks(lamp, {});
        EXPECT_LE(worst(grey_errors_levels(lamp, {8, double(unit)})), 0.5);
        if (unit > 8) {
            EXPECT_GT(worst(grey_errors_levels(lamp, {8, double(unit - 1)})), 0.5);
        }
    }
}

TEST(LampResponse, a_pulse_that_the_delay_eats_up_gives_no_light) {
    const auto light = grey_light_ticks({1, 0, 0, 0}, {8, 100});  // 125 ticks late, and level 1 lasts 100
    EXPECT_EQ(light[1], 0);
    EXPECT_DOUBLE_EQ(light[2], 75);
}

TEST(LampResponse, planes_follow_each_other_as_the_firmware_plays_them) {
    EXPECT_EQ(GreyTiming{}.shift_ticks, slot_shift_ticks(&as_built));
    for (const uint8_t planes : {2, 5, 8})
        for (const uint32_t unit : {8u, 77u, 200u, 1300u}) {
            const ols_slot slot{OLS_BASIS, 1, planes, 0, unit * ((1u << planes) - 1), 0, 0};
            EXPECT_EQ(grey_span_ticks({planes, double(unit)}), slot_span_ticks(&as_built, &slot));
        }
}
