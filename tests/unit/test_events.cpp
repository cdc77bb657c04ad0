// SPDX-License-Identifier: MIT
// Triggers with offsets, widths and slot kinds, played by an interpreter of the PIO programs.
// links: ols_firmware
#include "events.h"

#include "sequence_player.hpp"

using namespace ols::test;

namespace {

// Gives a program a lead, and its triggers and slots random offsets, widths and kinds. Not all of it can be played.
void randomise_triggers(std::mt19937& random, Program& program) {
    const auto between = [&](int low, int high) { return low + int(random() % uint32_t(high - low + 1)); };
    program.lead_ticks = random() % 2 ? 0 : uint32_t(between(0, 1500));
    program.slots.back().header.period_ticks += program.lead_ticks + 1000;
    for (ols_trigger& trigger : program.triggers) {
        trigger.offset_ticks = random() % 2 ? 0 : between(-1000, 1000);
        trigger.width_ticks = random() % 2 ? 0 : uint32_t(between(8, 1500));
        trigger.skip_kinds = random() % 3 ? 0 : uint8_t(random() % 16);
        trigger.active_low = random() % 2;
    }
    for (Slot& slot : program.slots)
        if (random() % 3 == 0) slot.header.trigger_offset_ticks = between(-300, 300);
}

// Whether the rules of PROTOCOL.md allow the program's triggers: inside the cycle, not over each other, and every two
// moments at which something begins coincide or are 8 ticks apart.
bool triggers_can_be_played(const Program& program) {
    const int64_t begin = -int64_t(program.lead_ticks) - SLOT_LATCH_TICKS;
    const int64_t end = begin + int64_t(cycle_ticks(program)) - 8;
    std::vector<int64_t> moments = {begin, end};
    int64_t light = 0;
    for (const Slot& slot : program.slots) {
        for (const Flash& flash : flashes(program, slot))
            moments.insert(moments.end(),
                           {light + flash.latch, light + flash.on, light + flash.off, light + flash.sent});
        light += slot.header.period_ticks;
    }
    for (int n = 0; n < OLS_TRIGGERS; n++) {
        int64_t earliest = begin;
        for (const Pulse& pulse : trigger_pulses(program, n)) {
            if (pulse.rise < earliest || pulse.fall > end) return false;
            earliest = pulse.fall + 8;
            moments.insert(moments.end(), {pulse.rise, pulse.fall});
        }
    }
    std::sort(moments.begin(), moments.end());
    for (size_t n = 1; n < moments.size(); n++) {
        const int64_t apart = moments[n] - moments[n - 1];
        if (apart != 0 && apart < 8) return false;
    }
    return true;
}

TEST(Events, triggers_with_offsets_and_widths_play_exactly_when_the_rules_allow_them_and_are_refused_otherwise) {
    std::mt19937 random(21);
    int played = 0, refused = 0;
    for (int repeat = 0; repeat < 400; repeat++) {
        SCOPED_TRACE("program " + std::to_string(repeat));
        Program program = random_program(random, 16, 1 + int(random() % 5));
        program.cycles = 1 + random() % 3;
        randomise_triggers(random, program);
        const Compiled compiled = compile(program);
        if (program.lead_ticks != 0 && program.lead_ticks < 8) continue;  // refused for that
        ASSERT_EQ(compiled.ok, triggers_can_be_played(program)) << compiled.error.text;
        if (compiled.ok) expect_plays_to_the_end(program, *compiled.words);
        (compiled.ok ? played : refused)++;
    }
    EXPECT_GT(played, 80);
    EXPECT_GT(refused, 80);
}

TEST(Events, an_early_trigger_reaches_into_the_lit_part_of_the_slot_before_it) {
    Program program;
    for (int n = 0; n < 4; n++) program.slots.push_back(slot(OLS_BASIS, 1500, 2000));
    program.slots.push_back(slot(OLS_DARK, 300, 4000));
    program.triggers[0].offset_ticks = -900;
    program.lead_ticks = 900;
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    expect_plays_to_the_end(program, *compiled.words);
}

}  // namespace
