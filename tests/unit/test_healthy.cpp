// SPDX-License-Identifier: MIT
// When HEALTHY may change: each turn of the main loop, as long as the light's pad obeys.
// links: ols_firmware
#include "healthy.h"

#include "link_fixture.hpp"

using namespace ols::test;

namespace {

struct Healthy : Link {
    // How often HEALTHY changes in ten turns of the main loop, each a millisecond.
    uint32_t changes_in_ten_turns() {
        const uint32_t before = board_host_healthy_changes();
        board_host_run_us(10'000);
        return board_host_healthy_changes() - before;
    }
    void arm_by_edge(ols_start_source source) {
        ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
        const uint32_t debounce_ticks = source == OLS_START_EACH_CYCLE_BY_EDGE ? 1'000 : 0;
        ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, uint8_t(source), {}, debounce_ticks})).ok(OLS_ARM));
        ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    }
};

TEST_F(Healthy, changes_once_a_turn_while_idle_loaded_armed_and_playing_and_in_a_fault_that_is_dark) {
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "idle";
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "loaded";
    ASSERT_TRUE(arm().ok(OLS_ARM));
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "armed";
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "playing";
    board_host_pull_stop_input(0, true);
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "the emergency stop is no doubt about the light";
    expect_fault(OLS_FAULT_EMERGENCY_STOP);
}

TEST_F(Healthy, goes_on_while_each_cycle_waits_for_its_edge_and_begins_whenever_it_comes) {
    arm_by_edge(OLS_START_EACH_CYCLE_BY_EDGE);
    EXPECT_EQ(changes_in_ten_turns(), 10u);
    board_host_genlock();  // lit now, though the main loop has not seen the edge yet
    EXPECT_EQ(changes_in_ten_turns(), 10u);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    EXPECT_EQ(status().fault, OLS_FAULT_NONE);
}

TEST_F(Healthy, ends_in_the_turn_that_finds_the_pad_lit_in_each_state_that_must_be_dark_and_the_fault_is_named) {
    for (int state = 0; state < 4; state++) {
        if (state == OLS_STATE_LOADED || state == OLS_STATE_ARMED) {
            ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
        }
        if (state == OLS_STATE_ARMED) {
            ASSERT_TRUE(arm().ok(OLS_ARM));
        }
        if (state == 3) arm_by_edge(OLS_START_BY_EDGE);
        ASSERT_GT(changes_in_ten_turns(), 0u);
        board_host_short_light(true);
        EXPECT_EQ(changes_in_ten_turns(), 0u) << state;
        EXPECT_FALSE(board_host_pins_are_connected());
        EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK) << state;
        board_host_short_light(false);
        expect_fault(OLS_FAULT_LIGHT_STUCK);
    }
}

TEST_F(Healthy, ends_right_after_a_program_that_leaves_the_pad_lit_has_been_stopped_or_has_ended) {
    play();
    board_host_run_us(5'000);
    ASSERT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    board_host_short_light(true);
    EXPECT_EQ(changes_in_ten_turns(), 0u);
    EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK);
    board_host_short_light(false);
    ASSERT_TRUE(ask(OLS_CLEAR_FAULT).ok(OLS_CLEAR_FAULT));
    play(1);
    board_host_run_us(20'000);
    ASSERT_EQ(status().state, OLS_STATE_DONE);
    board_host_short_light(true);
    EXPECT_EQ(changes_in_ten_turns(), 0u);
    EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK);
    board_host_short_light(false);
}

TEST_F(Healthy, does_not_come_back_with_the_dark_but_with_the_cleared_fault_which_a_lit_pad_refuses) {
    board_host_short_light(true);
    board_host_run_us(1'000);
    const Reply refused = ask(OLS_CLEAR_FAULT);
    EXPECT_EQ(refused.error(), OLS_ERROR_NOT_SAFE);
    EXPECT_NE(refused.text().find("LIGHT_EN"), std::string::npos) << refused.text();
    EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK);
    board_host_short_light(false);
    EXPECT_EQ(changes_in_ten_turns(), 0u) << "dark again, but nobody has looked";
    ASSERT_TRUE(ask(OLS_CLEAR_FAULT).ok(OLS_CLEAR_FAULT));
    EXPECT_EQ(changes_in_ten_turns(), 10u);
}

TEST_F(Healthy, ends_when_the_light_stays_after_another_fault_which_a_refused_clear_then_replaces) {
    play();
    board_host_run_us(5'000);
    board_host_pull_stop_input(0, true);
    board_host_short_light(true);
    EXPECT_EQ(changes_in_ten_turns(), 0u);
    EXPECT_EQ(status().fault, OLS_FAULT_EMERGENCY_STOP) << "the first one stays";
    board_host_short_light(false);
    EXPECT_EQ(changes_in_ten_turns(), 0u) << "until it is cleared";
    board_host_short_light(true);
    EXPECT_EQ(ask(OLS_CLEAR_FAULT).error(), OLS_ERROR_NOT_SAFE);
    EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK);
    board_host_short_light(false);
    ASSERT_TRUE(ask(OLS_CLEAR_FAULT).ok(OLS_CLEAR_FAULT));
    EXPECT_EQ(changes_in_ten_turns(), 10u);
}

TEST_F(Healthy, ends_when_the_light_watch_has_seen_too_long_a_light_until_that_is_cleared) {
    play();
    board_host_run_us(5'000);
    board_host_hold_light(50'001);
    EXPECT_EQ(changes_in_ten_turns(), 0u);
    expect_fault(OLS_FAULT_OVER_DUTY);
    EXPECT_EQ(changes_in_ten_turns(), 10u) << "cleared";
}

TEST_F(Healthy, arming_is_refused_while_the_pad_is_lit) {
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    board_host_short_light(true);
    EXPECT_EQ(arm().error(), OLS_ERROR_NOT_SAFE) << "in the very turn in which it is noticed";
    EXPECT_EQ(arm().error(), OLS_ERROR_FAULT_LATCHED);
    board_host_short_light(false);
}

TEST_F(Healthy, is_not_to_be_had_from_a_board_that_boots_with_the_pad_lit) {
    board_host_power_up();
    board_host_short_light(true);
    EXPECT_EQ(changes_in_ten_turns(), 0u);
    board_host_attach();
    EXPECT_EQ(status().fault, OLS_FAULT_LIGHT_STUCK);
    board_host_short_light(false);
}

}  // namespace
