// SPDX-License-Identifier: MIT
// The firmware's compiled sequences, played by an interpreter of the PIO programs: lamps and times are the program's.
// links: ols_firmware
#include "sequence.h"

#include "sequence_player.hpp"

using namespace ols::test;

namespace {

TEST(Sequence, random_programs_play_exactly_their_lamps_and_times) {
    std::mt19937 random(20);
    for (const uint16_t chain_bits : {1, 16, 31, 32, 33, 176, 255, 256}) {
        for (int repeat = 0; repeat < 3; repeat++) {
            SCOPED_TRACE(std::to_string(chain_bits) + " bits");
            Program program = random_program(random, chain_bits, 1 + int(random() % 12));
            program.cycles = 1 + random() % 3;
            const Compiled compiled = compile(program);
            ASSERT_TRUE(compiled.ok) << compiled.error.text;
            expect_plays_to_the_end(program, *compiled.words);
        }
    }
}

TEST(Sequence, exposures_and_periods_beyond_one_event_stay_exact) {
    // Around the 19 bits of an event's operand, where long holds come in.
    for (const uint32_t exposure_ticks : {524'200u, 524'293u, 524'294u, 524'295u, 524'301u, 1'200'007u}) {
        for (const uint32_t rest_ticks : {1400u, 524'312u, 524'313u, 524'314u, 700'001u}) {
            Program program;
            program.slots = {slot(OLS_BASIS, exposure_ticks, exposure_ticks + rest_ticks), slot(OLS_BASIS, 100, 2000)};
            program.slots[0].pattern[0] = 0x80000001;
            const Compiled compiled = compile(program);
            ASSERT_TRUE(compiled.ok) << compiled.error.text;
            Stage stage(program, *compiled.words);
            stage.arm();
            stage.run(3'000'000);
            expect_plays_program(stage, program);
        }
    }
}

TEST(Sequence, an_endless_program_goes_on_without_a_gap) {
    Program program;
    program.cycles = 0;
    program.slots = {slot(OLS_BASIS, 300, 1500), slot(OLS_DARK, 200, 1700)};
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok);
    Stage stage(program, *compiled.words);
    stage.arm();
    stage.run(3200 * 50 + SLOT_LATCH_TICKS);
    program.cycles = 50;
    stage.played.resize(100);
    expect_plays_program(stage, program);
}

// The words as the cycle feeds hand them over at a swap: the first program without its last word, then the second from
// its entry on.
TEST(Sequence, a_program_entered_at_the_end_of_anothers_cycle_plays_without_a_missing_or_late_slot) {
    std::mt19937 random(22);
    for (int repeat = 0; repeat < 20; repeat++) {
        Program first = random_program(random, 33, 1 + int(random() % 5), 1);
        Program second = random_program(random, 33, 1 + int(random() % 5), 1);
        first.cycles = repeat % 3 ? 0 : 7;
        second.cycles = 1 + random() % 3;
        const uint32_t first_cycles = 1 + random() % 4;
        const Compiled a = compile(first), b = compile(second);
        ASSERT_TRUE(a.ok && b.ok);
        Stage stage(first, *a.words);
        const auto append = [](std::vector<uint32_t>& table, const uint32_t* words, uint32_t count, uint32_t times) {
            for (; times > 0; times--) table.insert(table.end(), words, words + count);
        };
        std::vector<uint32_t>&timeline = stage.timeline.table, &shifter = stage.shifter.table;
        timeline.clear();
        append(timeline, sequence_enter(a.words.get()) + 1, a.words->cycle_words, first_cycles);
        timeline.pop_back();
        append(timeline, sequence_enter(b.words.get()), b.words->cycle_words + 1, 1);
        append(timeline, sequence_enter(b.words.get()) + 1, b.words->cycle_words, second.cycles);
        shifter.clear();
        append(shifter, sequence_patterns(a.words.get()), sequence_patterns_words(a.words.get()), first_cycles);
        append(shifter, sequence_patterns(b.words.get()), sequence_patterns_words(b.words.get()), second.cycles + 1);
        stage.arm();
        stage.run(1'000'000);
        EXPECT_EQ(stage.block.flags & 7, 1u << 1) << "the second program has counted its own cycles";
        // Both programs as one long one.
        Program both = first;
        both.cycles = 1;
        both.slots.clear();
        std::vector<size_t> begins;
        for (uint32_t cycle = 0; cycle < first_cycles + second.cycles; cycle++) {
            const std::vector<Slot>& slots = (cycle < first_cycles ? first : second).slots;
            begins.push_back(both.slots.size());
            both.slots.insert(both.slots.end(), slots.begin(), slots.end());
        }
        for (size_t n = 0; n < stage.played.size(); n++) {
            EXPECT_EQ(stage.played[n].sync, std::count(begins.begin(), begins.end(), n) == 1) << "slot " << n;
            stage.played[n].sync = n == 0;  // as in the long program
        }
        expect_plays_program(stage, both);
    }
}

TEST(Sequence, a_one_slot_cycle_still_gives_sync_an_edge_each_cycle) {
    Program program;
    program.cycles = 3;
    program.slots = {slot(OLS_BASIS, 300, 1500)};
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok);
    Stage stage(program, *compiled.words);
    stage.arm();
    int rises = 0;
    for (uint32_t before = 0; !stage.ended(); before = stage.block.pins) {
        stage.tick();
        rises += (stage.block.pins & ~before) >> SYNC & 1;
    }
    EXPECT_EQ(rises, 3);
}

TEST(Sequence, a_starved_timeline_is_dark_from_the_tick_at_which_the_missing_event_was_to_begin) {
    std::mt19937 random(3);
    const Program program = random_program(random, 176, 8);
    const Compiled compiled = compile(program);
    for (uint64_t words = 1; words < compiled.words->cycle_words; words++) {
        Stage fed(program, *compiled.words), starved(program, *compiled.words);
        starved.timeline.words_fed = words;
        fed.arm();
        starved.arm();
        while (fed.timeline.words_pulled <= words) {
            ASSERT_EQ(starved.block.pins, fed.block.pins);
            fed.tick();
            starved.tick();
        }
        for (int n = 0; n < 10'000; n++) {
            starved.tick();
            ASSERT_EQ(starved.block.pins & 0xff, 0u);
        }
        EXPECT_EQ(starved.block.flags & 7, 1u) << "and the processor is told";
    }
}

TEST(Sequence, a_starved_shifter_never_lets_half_a_pattern_be_latched) {
    std::mt19937 random(4);
    const Program program = random_program(random, 176, 8);
    const Compiled compiled = compile(program);
    const uint64_t all_words = sequence_patterns_words(compiled.words.get());
    for (uint64_t words = compiled.words->pattern_words; words < all_words; words++) {
        Stage stage(program, *compiled.words);
        stage.shifter.words_fed = words;
        stage.arm();
        stage.run(100'000);
        EXPECT_EQ(stage.block.flags & 7, 1u << 2) << "the shifter says so";
        for (int n = 0; n < 20'000; n++) stage.tick();
        // A trigger that is up may stay so until the processor has stopped everything.
        EXPECT_EQ(stage.block.pins >> LIGHT_EN & 1, 0u) << "and the timeline waits in the dark";
        EXPECT_EQ(stage.block.pins >> LATCH & 1, 0u);
        EXPECT_EQ(stage.played.size(), words / compiled.words->pattern_words);
        for (const Stage::Played& played : stage.played) EXPECT_EQ(played.lamps.size(), 176u);
    }
}

TEST(Sequence, the_stated_shift_time_is_what_a_shift_takes) {
    for (const uint16_t chain_bits : {1, 32, 33, 176, 256}) {
        Program program;
        program.board.chain_bits = chain_bits;
        program.slots = {slot(OLS_BASIS, 5000, 6000, (chain_bits + 31) / 32)};
        Stage stage(program, *compile(program).words);
        stage.arm();
        while (!(stage.block.pins >> LIGHT_EN & 1)) stage.tick();
        uint32_t taken_ticks = 0;
        for (; !(stage.block.flags >> 5 & 1); taken_ticks++) stage.tick();
        const uint32_t stated_ticks = slot_shift_ticks(&program.board);
        // This interpreter shows each of the two flags a tick earlier than PIO; and one for the divided clock's phase.
        EXPECT_EQ(stated_ticks, taken_ticks + 3) << chain_bits << " bits";
    }
}

TEST(Sequence, the_shortest_period_that_is_accepted_plays) {
    // The shortest period that is accepted plays; its shift ends just before the sync asks for it.
    Program program;
    const uint32_t shortest_ticks = slot_shift_ticks(&program.board) + slot_gap_ticks();
    program.slots = {slot(OLS_BASIS, 8, shortest_ticks),
                     slot(OLS_BASIS, shortest_ticks - slot_gap_ticks(), shortest_ticks)};
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    Stage stage(program, *compiled.words);
    stage.arm();
    stage.run(100'000);
    expect_plays_program(stage, program);
    EXPECT_LT(shortest_ticks, 1300u) << "10.4 us: 2160 Hz leaves 452 of 463 us for light";
}

TEST(Sequence, what_cannot_be_played_is_refused_with_slot_and_reason) {
    const auto refused = [](auto change, const char* reason) {
        Program program;
        for (int n = 0; n < 4; n++) program.slots.push_back(slot(OLS_BASIS, 1000, 3000));
        change(program);
        const Compiled compiled = compile(program);
        EXPECT_FALSE(compiled.ok);
        EXPECT_EQ(compiled.error.code, OLS_ERROR_BAD_PROGRAM);
        EXPECT_NE(std::string(compiled.error.text).find(reason), std::string::npos) << compiled.error.text;
        return compiled.error.slot;
    };
    EXPECT_EQ(refused([](Program& p) { p.slots[2].header.kind = 4; }, "unknown kind 4"), 2);
    EXPECT_EQ(refused([](Program& p) { p.slots[1].header.trigger_mask = 16; }, "trigger mask 16"), 1);
    EXPECT_EQ(refused([](Program& p) { p.slots[3].header.reserved = 1; }, "reserved"), 3);
    EXPECT_EQ(refused([](Program& p) { p.slots[0].header.trigger_offset_ticks = -20; }, "raise lead_ticks by 8"), 0);
    EXPECT_EQ(refused([](Program& p) { p.slots[2].header.trigger_offset_ticks = 7; }, "8 ticks away"), 2);
    EXPECT_EQ(refused([](Program& p) { p.slots[1].header.trigger_offset_ticks = 2100; }, "overlaps"), 2);
    EXPECT_EQ(refused([](Program& p) { p.slots[3].header.trigger_offset_ticks = 2000; }, "ends after the cycle"), 3);
    EXPECT_EQ(refused([](Program& p) { p.lead_ticks = 2000; }, "room for lead_ticks of "), 3);
    EXPECT_EQ(refused([](Program& p) { p.lead_ticks = 5; }, "0 or at least 8"), OLS_NO_SLOT);
    EXPECT_EQ(refused([](Program& p) { p.triggers[3].width_ticks = 7; }, "0 or at least 8"), OLS_NO_SLOT);
    EXPECT_EQ(refused([](Program& p) { p.triggers[2].skip_kinds = 16; }, "trigger 2"), OLS_NO_SLOT);
    EXPECT_EQ(refused([](Program& p) { p.slots[0].header.exposure_ticks = 7; }, "at least 8 ticks"), 0);
    EXPECT_EQ(refused([](Program& p) { p.slots[1].header.exposure_ticks = 2974; }, "exceed the exposure"), 1);
    EXPECT_EQ(refused([](Program& p) { p.slots[1].header.exposure_ticks = 0xffffffff; }, "exceed the exposure"), 1);
    EXPECT_EQ(refused([](Program& p) { p.slots[2].header.period_ticks = 1100; }, "slot 2: period"), 2);
    EXPECT_EQ(refused([](Program& p) { p.slots[2].pattern[5] = 0x00008000; }, "past the end of the chain"), 2);
    EXPECT_EQ(refused(
                  [](Program& p) {
                      p.slots[3].header.kind = OLS_DARK;
                      p.slots[3].pattern[0] = 1;
                  },
                  "dark slot"),
              3);
    EXPECT_EQ(refused([](Program& p) { p.slots.clear(); }, "1 to 1024 slots"), OLS_NO_SLOT);
    EXPECT_EQ(refused([](Program& p) { p.slots.resize(1025, p.slots[0]); }, "1 to 1024 slots"), OLS_NO_SLOT);
    EXPECT_EQ(refused([](Program& p) { p.slots[1].pattern.pop_back(); }, "has 160 bytes"), OLS_NO_SLOT);
    EXPECT_LT(refused(
                  [](Program& p) {
                      for (Slot& s : p.slots) s.header.period_ticks = 0xfffffff0;
                      p.slots.resize(1024, p.slots[0]);
                  },
                  "bytes"),
              OLS_SLOTS_MAX);
}

TEST(Sequence, a_program_for_another_chain_is_refused) {
    Program program;
    program.slots = {slot(OLS_BASIS, 1000, 3000)};
    Compiled compiled = compile(program);
    compiled.words->header.chain_bits = 160;
    sequence_compiler compiler;
    sequence_begin(&compiler, &program.board, compiled.words.get());
    EXPECT_EQ(sequence_step(&compiler, &compiled.error), SEQUENCE_REFUSED);
    EXPECT_STREQ(compiled.error.text, "this board's chain has 176 bits: compile the program for that");
}

TEST(Sequence, a_full_program_of_1024_slots_fits) {
    Program program;
    for (int n = 0; n < OLS_SLOTS_MAX; n++) program.slots.push_back(slot(OLS_BASIS, 51'500, 57'870));
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    const uint32_t bytes = 4 * (compiled.words->cycle_words + sequence_patterns_words(compiled.words.get()));
    EXPECT_EQ(bytes, 1024u * 36 + 4) << "36 bytes a slot, and the end of the cycle";
}

TEST(Sequence, a_full_program_with_four_triggers_of_their_own_fits) {
    Program program;
    for (int n = 0; n < OLS_SLOTS_MAX; n++) program.slots.push_back(slot(OLS_BASIS, 51'500, 57'870, 6, 15));
    for (int n = 0; n < OLS_TRIGGERS; n++) program.triggers[n] = {100 * (n + 1), 1000u * (n + 1), 0, 0, 0};
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    EXPECT_EQ(compiled.words->cycle_words, 1024u * (3 + 8) + 1);
}

TEST(Witness, counts_every_second_tick_in_every_path) {
    std::mt19937 random(6);
    PioBlock block;
    PioMachine witness{block, WITNESS_PROGRAM, WITNESS_WRAP_TARGET, WITNESS_WRAP};
    witness.pc = WITNESS_WRAP_TARGET;
    for (int repeat = 0; repeat < 500; repeat++) {
        witness.x = random() % 3000;  // passes zero somewhere below, with the pin low or high or changing
        witness.pushed.clear();
        std::vector<uint64_t> rises;
        uint64_t now = 0;
        const auto run = [&](uint64_t ticks) {
            for (; ticks > 0; ticks--, now++) witness.tick();
        };
        for (int edge = 0; edge < 10; edge++) {
            block.pins = 0;
            run(8 + random() % 500);
            block.pins = 1;
            rises.push_back(now);
            run(8 + random() % 500);
        }
        ASSERT_EQ(witness.pushed.size(), rises.size());
        for (size_t n = 1; n < rises.size(); n++) {
            const uint32_t counted = witness.pushed[0] - witness.pushed[n];
            EXPECT_LE(std::abs(int64_t(2 * counted) - int64_t(rises[n] - rises[0])), 2) << "edge " << n;
        }
    }
}

}  // namespace
