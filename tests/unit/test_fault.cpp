// SPDX-License-Identifier: MIT
// Faults across resets: what ended a run is told by the next one, with slot and tick, and nothing else is. The board is a
// few words that survive a reset, played here.
// links: ols_firmware
#include "fault.h"

#include <gtest/gtest.h>

#include <csetjmp>
#include <cstring>
#include <string>
#include <vector>

namespace {

// What fault.c asks of the machine, in order.
struct Machine {
    uint32_t surviving[3] = {0, 0, 0};
    bool reset_by_watchdog = false;
    bool light_is_on = false;
    std::vector<std::string> calls;
    jmp_buf reset;
} machine;

}  // namespace

extern "C" {
void board_dark(void) {
    machine.calls.push_back("dark");
}
void player_stop(void) {
    machine.calls.push_back("stop");
}
void board_remember(const uint32_t words[3]) {
    std::memcpy(machine.surviving, words, sizeof machine.surviving);
    machine.calls.push_back("remember");
}
void board_recall(uint32_t words[3]) {
    std::memcpy(words, machine.surviving, sizeof machine.surviving);
}
bool board_was_reset_by_watchdog(void) {
    return machine.reset_by_watchdog;
}
bool board_light_is_on(void) {
    return machine.light_is_on;
}
void board_reset(void) {
    machine.calls.push_back("reset");
    longjmp(machine.reset, 1);
}
}

namespace {

class Fault : public testing::Test {
  protected:
    void SetUp() override {
        machine = {};
        fault_init();
        machine.calls.clear();
    }

    void boot(bool by_watchdog) {
        machine.reset_by_watchdog = by_watchdog;
        fault_init();
    }

    void exception() {
        if (setjmp(machine.reset) == 0) fault_in_exception();
    }

    static void expect_latched(ols_fault cause, uint16_t slot, uint64_t ticks) {
        EXPECT_EQ(fault_latched().cause, cause);
        EXPECT_EQ(fault_latched().slot, slot);
        EXPECT_EQ(fault_latched().ticks, ticks);
    }
};

constexpr uint64_t late_ticks = 0x12345678'9abcdef1;

TEST_F(Fault, a_board_that_powers_up_has_none_whatever_its_scratch_words_hold) {
    for (const uint32_t word : {0u, 0xffffffffu, 0x5d000000u, 0x5d050007u}) {
        machine.surviving[0] = machine.surviving[1] = machine.surviving[2] = word;
        boot(false);
        expect_latched(OLS_FAULT_NONE, OLS_NO_SLOT, 0);
    }
}

TEST_F(Fault, a_hang_while_playing_is_told_with_slot_and_tick_by_the_next_run) {
    for (const uint16_t slot : {uint16_t(0), uint16_t(179), uint16_t(1023), uint16_t(OLS_NO_SLOT)}) {
        fault_note_progress(slot, late_ticks);
        boot(true);
        expect_latched(OLS_FAULT_WATCHDOG, slot, late_ticks);
        EXPECT_TRUE(fault_clear());
        expect_latched(OLS_FAULT_NONE, OLS_NO_SLOT, 0);
    }
}

TEST_F(Fault, none_is_cleared_while_the_light_is_on_and_that_is_what_is_latched_instead) {
    fault_latch(OLS_FAULT_EMERGENCY_STOP, 7, late_ticks);
    machine.light_is_on = true;
    EXPECT_FALSE(fault_clear());
    expect_latched(OLS_FAULT_LIGHT_STUCK, OLS_NO_SLOT, 0);
    EXPECT_FALSE(fault_clear());
    expect_latched(OLS_FAULT_LIGHT_STUCK, OLS_NO_SLOT, 0);
    machine.light_is_on = false;
    EXPECT_TRUE(fault_clear());
    expect_latched(OLS_FAULT_NONE, OLS_NO_SLOT, 0);
}

TEST_F(Fault, a_hang_while_nothing_played_is_told_without_slot_and_tick) {
    fault_note_progress(5, late_ticks);
    fault_note_idle();
    boot(true);
    expect_latched(OLS_FAULT_WATCHDOG, OLS_NO_SLOT, 0);
}

TEST_F(Fault, what_a_run_has_told_is_not_told_again_by_the_one_after_it) {
    fault_note_progress(5, late_ticks);
    boot(true);
    boot(true);  // hung again, before anything played
    expect_latched(OLS_FAULT_WATCHDOG, OLS_NO_SLOT, 0);
}

TEST_F(Fault, an_exception_is_dark_first_then_noted_then_a_reset) {
    fault_note_progress(77, late_ticks);
    machine.calls.clear();
    exception();
    EXPECT_EQ(machine.calls, (std::vector<std::string>{"dark", "remember", "reset"}));
    boot(true);
    expect_latched(OLS_FAULT_PROCESSOR, 77, late_ticks);
}

TEST_F(Fault, an_exception_while_nothing_played_names_no_slot) {
    exception();
    boot(true);
    expect_latched(OLS_FAULT_PROCESSOR, OLS_NO_SLOT, 0);
}

TEST_F(Fault, the_first_cause_stays_and_every_one_stops) {
    fault_latch(OLS_FAULT_EMERGENCY_STOP, 4, 1000);
    fault_latch(OLS_FAULT_HEARTBEAT, 5, 2000);
    expect_latched(OLS_FAULT_EMERGENCY_STOP, 4, 1000);
    EXPECT_EQ(machine.calls, (std::vector<std::string>{"stop", "remember", "stop", "remember"}));
    fault_clear();
    fault_latch(OLS_FAULT_HEARTBEAT, 5, 2000);
    expect_latched(OLS_FAULT_HEARTBEAT, 5, 2000);
}

TEST_F(Fault, a_latched_fault_leaves_nothing_for_a_later_hang_to_tell) {
    fault_note_progress(9, late_ticks);
    fault_latch(OLS_FAULT_OPEN_LAMP, 9, 500);
    boot(true);
    expect_latched(OLS_FAULT_WATCHDOG, OLS_NO_SLOT, 0);
}

}  // namespace
