// SPDX-License-Identifier: MIT
// Every way in which the board without hardware ends dark, and what it refuses to light at all.
// links: ols_firmware
#include "link_fixture.hpp"
#include "schedule.h"

using namespace ols::test;

namespace {

using Stops = Link;

TEST_F(Stops, a_starved_timeline_is_a_fault_with_slot_and_tick) {
    play();
    board_host_run_us(10'000);
    board_host_starve_timeline();
    board_host_run_us(1'000);
    const ols_status_reply now = status();
    EXPECT_EQ(now.fault_slot, (10'000 * 125 / 57'870) % 18);
    EXPECT_NEAR(double(now.fault_ticks), 11'000 * 125, 1000 * 125);
    expect_fault(OLS_FAULT_TIMELINE_STARVED);
}

TEST_F(Stops, a_starved_shifter_is_a_fault_while_playing_and_arming) {
    play();
    board_host_starve_shifter();
    board_host_run_us(1'000);
    expect_fault(OLS_FAULT_SHIFTER_STARVED);
    ASSERT_TRUE(load(program(18)).ok(OLS_LOAD_END));
    EXPECT_EQ(arm().error(), OLS_ERROR_FAULT_LATCHED);
    expect_fault(OLS_FAULT_SHIFTER_STARVED);
}

TEST_F(Stops, a_late_trigger_is_a_fault) {
    play();
    board_host_run_us(10'000);
    board_host_delay_triggers(40);
    board_host_run_us(2'000);
    expect_fault(OLS_FAULT_SLIPPED);
}

TEST_F(Stops, a_trigger_that_is_late_by_no_more_than_the_cables_echo_is_none) {
    play();
    board_host_run_us(10'000);
    board_host_delay_triggers(BOARD_CABLE_TRIGGER_ECHO_TICKS);
    board_host_run_us(2'000);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    board_host_delay_triggers(SCHEDULE_TOLERANCE_TICKS + 2);
    board_host_run_us(2'000);
    expect_fault(OLS_FAULT_SLIPPED);
}

TEST_F(Stops, a_lost_host_is_a_fault_while_armed_and_while_playing_and_none_while_idle) {
    board_host_detach();
    board_host_run_us(2'000);
    board_host_attach();
    EXPECT_EQ(status().state, OLS_STATE_IDLE);
    play();
    board_host_detach();
    board_host_run_us(1'000);
    EXPECT_FALSE(board_host_pins_are_connected());
    board_host_attach();
    expect_fault(OLS_FAULT_HOST_LOST);
    ASSERT_TRUE(load(program(18)).ok(OLS_LOAD_END));
    ASSERT_TRUE(arm().ok(OLS_ARM));
    board_host_detach();
    board_host_run_us(1'000);
    board_host_attach();
    expect_fault(OLS_FAULT_HOST_LOST);
}

TEST_F(Stops, each_stop_input_is_a_fault_of_its_own_while_armed_and_while_playing_however_short) {
    const ols_fault causes[] = {OLS_FAULT_EMERGENCY_STOP, OLS_FAULT_OVER_TEMPERATURE, OLS_FAULT_OPEN_LAMP};
    for (unsigned input = 0; input < 3; input++) {
        play();
        board_host_run_us(5'000);
        board_host_pull_stop_input(input, true);
        board_host_pull_stop_input(input, false);
        EXPECT_FALSE(board_host_pins_are_connected()) << "at once";
        board_host_run_us(1'000);
        EXPECT_EQ(status().fault_slot, 5'000 * 125 / 57'870) << "the last before it was dark";
        EXPECT_EQ(status().fault_ticks, 5'000 * 125u);
        expect_fault(causes[input]);
        ASSERT_TRUE(load(program(18)).ok(OLS_LOAD_END));
        ASSERT_TRUE(arm().ok(OLS_ARM));
        board_host_pull_stop_input(input, true);
        board_host_run_us(1'000);
        expect_fault(causes[input]);
        ASSERT_TRUE(load(program(18)).ok(OLS_LOAD_END));
        EXPECT_EQ(arm().error(), OLS_ERROR_NOT_SAFE) << "while it is low";
        EXPECT_EQ(status().state, OLS_STATE_LOADED);
        board_host_pull_stop_input(input, false);
        EXPECT_TRUE(arm().ok(OLS_ARM)) << "and what fell while nothing was armed is forgotten";
        EXPECT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    }
}

TEST_F(Stops, a_silent_host_is_a_fault_only_with_a_heartbeat_and_any_message_is_one) {
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    EXPECT_EQ(arm(OLS_HEARTBEAT_TICKS_MIN - 1).error(), OLS_ERROR_BAD_PROGRAM);
    ASSERT_TRUE(arm(20 * 125'000).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    for (int n = 0; n < 5; n++) {
        board_host_run_us(19'000);
        EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    }
    board_host_run_us(19'000);
    EXPECT_TRUE(board_host_pins_are_connected());
    board_host_run_us(3'000);
    EXPECT_FALSE(board_host_pins_are_connected());
    expect_fault(OLS_FAULT_HEARTBEAT);
    play();
    board_host_run_us(60'000'000);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
}

TEST_F(Stops, a_light_longer_than_any_of_the_programs_is_a_fault_while_it_plays) {
    play();
    board_host_run_us(5'000);
    board_host_hold_light(50'000);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING) << "as long as the longest";
    board_host_hold_light(50'001);
    EXPECT_FALSE(board_host_pins_are_connected());
    EXPECT_EQ(status().fault_slot, 5'000 * 125 / 57'870);
    expect_fault(OLS_FAULT_OVER_DUTY);
}

TEST_F(Stops, the_longest_light_is_that_of_both_programs_during_a_swap_and_then_of_the_new_one) {
    Bytes longer = program(18), shorter = program(18);
    for (size_t n = 0; n < 18; n++) {
        const uint32_t long_ticks = 51'000, short_ticks = 49'000;
        memcpy(&longer[n * 16 + 4], &long_ticks, 4);
        memcpy(&shorter[n * 16 + 4], &short_ticks, 4);
    }
    play();
    ASSERT_TRUE(load(longer, 0).ok(OLS_LOAD_END));
    board_host_hold_light(50'000);
    ASSERT_TRUE(ask(OLS_SWAP).ok(OLS_SWAP));
    board_host_hold_light(51'000);
    board_host_run_us(30'000);
    ASSERT_EQ(status().next, OLS_NEXT_NONE) << "swapped";
    board_host_hold_light(51'000);
    ASSERT_TRUE(load(shorter, 0).ok(OLS_LOAD_END));
    ASSERT_TRUE(ask(OLS_SWAP).ok(OLS_SWAP));
    board_host_hold_light(51'000);
    board_host_run_us(30'000);
    ASSERT_EQ(status().next, OLS_NEXT_NONE) << "swapped";
    EXPECT_TRUE(board_host_pins_are_connected());
    board_host_hold_light(49'001);
    expect_fault(OLS_FAULT_OVER_DUTY);
}

TEST_F(Stops, a_program_that_changes_in_memory_while_it_plays_is_a_fault_within_one_reading_of_it) {
    play();
    board_host_run_us(5'000);
    board_host_corrupt_program();
    board_host_run_us(2 * 1'000 * (18 * (16 + 24 + 16) / 256 + 2));
    expect_fault(OLS_FAULT_BAD_MEMORY);
}

TEST_F(Stops, a_stop_command_that_comes_after_a_stop_input_does_not_hide_the_fault) {
    play();
    board_host_run_us(5'000);
    board_host_pull_stop_input(0, true);
    board_host_pull_stop_input(0, false);
    ask(OLS_STOP);
    expect_fault(OLS_FAULT_EMERGENCY_STOP);
}

TEST_F(Stops, a_program_that_lights_a_lamp_for_too_much_of_the_cycle_is_refused) {
    Bytes hot = program(18);
    for (int n = 0; n < 18; n++) hot[size_t(18 * 16 + n * 24)] = 1;  // one lamp in every slot, 86 %
    const Reply reply = load(hot);
    EXPECT_EQ(reply.error(), OLS_ERROR_OVER_LIMIT);
    EXPECT_NE(reply.text().find("chain bit 31"), std::string::npos) << reply.text();
}

TEST_F(Stops, a_stage_that_waits_for_an_edge_can_be_stopped_and_ends_dark_like_one_that_plays) {
    ASSERT_TRUE(load(program(18), 1).ok(OLS_LOAD_END));
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, OLS_START_BY_EDGE, {}, 0})).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    ASSERT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    EXPECT_EQ(status().state, OLS_STATE_LOADED);
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, OLS_START_BY_EDGE, {}, 0})).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_detach();
    board_host_run_us(1'000);
    board_host_attach();
    expect_fault(OLS_FAULT_HOST_LOST);
}

TEST_F(Stops, a_hang_is_a_fault_with_slot_after_the_reset) {
    play();
    board_host_run_us(5'000);
    const uint32_t nonce = status().boot_nonce;
    board_host_bite();
    board_host_attach();
    const ols_status_reply now = status();
    EXPECT_NE(now.boot_nonce, nonce);
    EXPECT_EQ(now.fault_slot, 5'000 * 125 / 57'870);
    expect_fault(OLS_FAULT_WATCHDOG);
}

TEST_F(Stops, a_program_that_changed_in_memory_is_a_fault) {
    play(1);
    board_host_run_us(20'000);
    board_host_corrupt_program();
    EXPECT_EQ(arm().error(), OLS_ERROR_FAULT_LATCHED);
    expect_fault(OLS_FAULT_BAD_MEMORY);
}

TEST_F(Stops, the_first_fault_stays_latched_when_more_follow) {
    play();
    board_host_run_us(5'000);
    board_host_starve_timeline();
    board_host_run_us(1'000);
    board_host_detach();
    board_host_run_us(5'000);
    board_host_attach();
    EXPECT_EQ(status().fault, OLS_FAULT_TIMELINE_STARVED);
}

}  // namespace
