// SPDX-License-Identifier: MIT
// The firmware's compiled sequences, played by an interpreter of the PIO programs: lamps and times are the program's.
// links: ols_firmware
#include "sequence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <string>

#include "pio_interpreter.hpp"
#include "pulse.h"

using ols::test::PioBlock;
using ols::test::PioMachine;

namespace {

struct Slot {
    ols_slot header{};
    std::vector<uint32_t> pattern;
};

struct Program {
    sequence_board board{176, 1};
    uint32_t cycles = 1;
    uint32_t lead_ticks = 0;
    ols_trigger triggers[OLS_TRIGGERS]{};
    std::vector<Slot> slots;

    std::vector<uint8_t> bytes() const {
        std::vector<uint8_t> all;
        const auto append = [&](const void* from, size_t count) {
            const auto* first = static_cast<const uint8_t*>(from);
            all.insert(all.end(), first, first + count);
        };
        for (const Slot& slot : slots) {
            append(&slot.header, sizeof slot.header);
            append(slot.pattern.data(), slot.pattern.size() * 4);
        }
        return all;
    }
};

struct Compiled {
    bool ok = false;
    std::unique_ptr<sequence> words = std::make_unique<sequence>();
    ols_error_reply error{};
};

Compiled compile(const Program& program) {
    const std::vector<uint8_t> bytes = program.bytes();
    ols_load_begin header{};
    header.slot_count = uint16_t(program.slots.size());
    header.chain_bits = program.board.chain_bits;
    header.cycles = program.cycles;
    header.program_bytes = uint32_t(bytes.size());
    header.lead_ticks = program.lead_ticks;
    std::copy(std::begin(program.triggers), std::end(program.triggers), header.triggers);
    Compiled result;
    result.ok = sequence_compile(&program.board, &header, bytes.data(), result.words.get(), &result.error);
    return result;
}

bool bit_of(const std::vector<uint32_t>& words, int bit) {
    return words[bit / 32] >> (31 - bit % 32) & 1;
}

Slot slot(ols_slot_kind kind, uint32_t exposure_ticks, uint32_t period_ticks, int words = 6, uint8_t trigger_mask = 1) {
    Slot made;
    made.header.kind = uint8_t(kind);
    made.header.trigger_mask = trigger_mask;
    made.header.exposure_ticks = exposure_ticks;
    made.header.period_ticks = period_ticks;
    made.pattern.assign(size_t(words), 0);
    return made;
}

Program random_program(std::mt19937& random, uint16_t chain_bits, int slot_count) {
    Program program;
    program.board.chain_bits = chain_bits;
    const int words = (chain_bits + 31) / 32;
    const uint32_t shift_ticks = sequence_shift_ticks(&program.board), gap_ticks = sequence_slot_gap_ticks();
    for (int n = 0; n < slot_count; n++) {
        const uint32_t exposure_ticks = 16 + random() % 4000;
        const uint32_t spare_ticks = random() % 3 ? random() % 2000 : 0;
        const uint32_t period_ticks = std::max(exposure_ticks, shift_ticks) + gap_ticks + spare_ticks;
        Slot made = slot(ols_slot_kind(random() % 4), exposure_ticks, period_ticks, words, uint8_t(random() % 16));
        if (made.header.kind != OLS_DARK)
            for (int bit = 0; bit < chain_bits; bit++)
                made.pattern[bit / 32] |= uint32_t(random() & 1) << (31 - bit % 32);
        program.slots.push_back(made);
    }
    return program;
}

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

struct Pulse {
    int64_t rise, fall;
    bool operator==(const Pulse&) const = default;
};

// What trigger n does in one cycle, from the program alone: ticks since the light of slot 0.
std::vector<Pulse> trigger_pulses(const Program& program, int n) {
    const ols_trigger& trigger = program.triggers[n];
    std::vector<Pulse> pulses;
    int64_t light = 0;
    for (const Slot& slot : program.slots) {
        if (slot.header.trigger_mask >> n & 1 && !(trigger.skip_kinds >> slot.header.kind & 1)) {
            const int64_t rise = light + slot.header.trigger_offset_ticks + trigger.offset_ticks;
            pulses.push_back({rise, rise + (trigger.width_ticks ? trigger.width_ticks : slot.header.exposure_ticks)});
        }
        light += slot.header.period_ticks;
    }
    return pulses;
}

uint64_t cycle_ticks(const Program& program) {
    uint64_t ticks = 0;
    for (const Slot& slot : program.slots) ticks += slot.header.period_ticks;
    return ticks;
}

// Whether the rules of PROTOCOL.md allow the program's triggers: inside the cycle, not over each other, and every two
// moments at which something begins coincide or are 8 ticks apart.
bool triggers_can_be_played(const Program& program) {
    const int64_t begin = -int64_t(program.lead_ticks) - SEQUENCE_LATCH_TICKS;
    const int64_t end = begin + int64_t(cycle_ticks(program)) - 8;
    std::vector<int64_t> moments = {begin, end};
    int64_t light = 0;
    for (const Slot& slot : program.slots) {
        const int64_t shift = sequence_shift_ticks(&program.board);
        const int64_t lit = slot.header.kind == OLS_DARK ? 8 : slot.header.exposure_ticks;
        const int64_t sent = lit >= shift ? lit : std::max(lit + 8, shift);
        moments.insert(moments.end(), {light - SEQUENCE_LATCH_TICKS, light, light + lit, light + sent});
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

// Pins of the interpreter, timeline first as on the board.
enum { LATCH, LIGHT_EN, TRIG0, SYNC = 6, DATA = 8, CLK = 9 };

// Both machines, the chain of drivers behind them, and what happened: one entry for each LATCH.
struct Stage {
    struct Played {
        int64_t latch = 0;
        Pulse light{0, 0};
        bool sync = false;
        std::vector<bool> lamps;
    };

    PioBlock block;
    PioMachine timeline{block, TIMELINE_PROGRAM, TIMELINE_WRAP_TARGET, TIMELINE_WRAP};
    PioMachine shifter{block, SHIFTER_PROGRAM, SHIFTER_WRAP_TARGET, SHIFTER_WRAP};
    std::vector<bool> chain;
    std::vector<Played> played;
    std::vector<Pulse> triggers[4];
    uint64_t now = 0;
    uint32_t pins_before = 0;

    Stage(const Program& program, const sequence& words) {
        timeline.out_count = 8;
        timeline.shift_right = true;
        timeline.pc = TIMELINE_NEXT;
        timeline.table.assign(words.events, words.events + words.event_count);
        timeline.y = words.cycles - 1;
        shifter.side_bits = 1;
        shifter.side_pin = CLK;
        shifter.out_pin = DATA;
        shifter.out_count = 1;
        shifter.status_below = words.pattern_words;
        shifter.isr = program.board.chain_bits - 1u;
        shifter.table.assign(words.patterns, words.patterns + words.slot_count * words.pattern_words);
    }

    void tick() {
        timeline.tick();
        shifter.tick();
        now++;
        see_pins();
    }

    // As player_arm does: the first pattern is in the chain before the timeline starts.
    void arm() {
        block.flags = 1 << 4;
        for (int n = 0; n < 10000 && !(block.flags & 1 << 5); n++) {
            shifter.tick();
            see_pins();
        }
        block.flags = 0;
    }

    bool ended() const { return block.flags & 7; }

    void run(uint64_t ticks) {
        for (const uint64_t end = now + ticks; now < end && !ended();) tick();
    }

  private:
    void see_pins() {
        const uint32_t up = block.pins & ~pins_before, down = pins_before & ~block.pins;
        pins_before = block.pins;
        if (up >> CLK & 1) chain.push_back(block.pins >> DATA & 1);
        if (up >> LATCH & 1) {
            Played next;
            next.latch = int64_t(now);
            next.lamps = std::exchange(chain, {});
            next.sync = block.pins >> SYNC & 1;
            played.push_back(next);
        }
        if (up >> LIGHT_EN & 1) played.back().light.rise = int64_t(now);
        if (down >> LIGHT_EN & 1) played.back().light.fall = int64_t(now);
        for (int n = 0; n < 4; n++) {
            if (up >> (TRIG0 + n) & 1) triggers[n].push_back({int64_t(now), 0});
            if (down >> (TRIG0 + n) & 1) triggers[n].back().fall = int64_t(now);
        }
    }
};

void expect_plays_program(const Stage& stage, const Program& program) {
    ASSERT_EQ(stage.played.size(), program.slots.size() * program.cycles);
    const int64_t first_light = stage.played[0].latch + SEQUENCE_LATCH_TICKS;
    int64_t light = first_light;
    for (size_t n = 0; n < stage.played.size(); n++) {
        SCOPED_TRACE("slot " + std::to_string(n));
        const Stage::Played& played = stage.played[n];
        const Slot& slot = program.slots[n % program.slots.size()];
        const bool lit = slot.header.kind != OLS_DARK;
        EXPECT_EQ(played.latch, light - SEQUENCE_LATCH_TICKS);
        EXPECT_EQ(played.light, lit ? (Pulse{light, light + slot.header.exposure_ticks}) : (Pulse{0, 0}));
        EXPECT_EQ(played.sync, n % program.slots.size() == 0);
        ASSERT_EQ(played.lamps.size(), program.board.chain_bits);
        for (int bit = 0; bit < program.board.chain_bits; bit++)
            ASSERT_EQ(played.lamps[bit], bit_of(slot.pattern, bit)) << "bit " << bit;
        light += slot.header.period_ticks;
    }
    for (int n = 0; n < OLS_TRIGGERS; n++) {
        std::vector<Pulse> expected;
        for (uint32_t cycle = 0; cycle < program.cycles; cycle++)
            for (const Pulse& pulse : trigger_pulses(program, n)) {
                const int64_t origin = first_light + int64_t(cycle * cycle_ticks(program));
                expected.push_back({origin + pulse.rise, origin + pulse.fall});
            }
        EXPECT_EQ(stage.triggers[n], expected) << "trigger " << n;
    }
}

void expect_plays_to_the_end(const Program& program, const sequence& words) {
    Stage stage(program, words);
    stage.arm();
    stage.run(20'000'000);
    EXPECT_EQ(stage.block.flags & 7, 1u << 1) << "ends by having played all cycles";
    EXPECT_EQ(stage.block.pins & 0xff, 0u);
    expect_plays_program(stage, program);
}

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

TEST(Sequence, triggers_with_offsets_and_widths_play_exactly_when_the_rules_allow_them_and_are_refused_otherwise) {
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

TEST(Sequence, an_early_trigger_reaches_into_the_lit_part_of_the_slot_before_it) {
    Program program;
    for (int n = 0; n < 4; n++) program.slots.push_back(slot(OLS_BASIS, 1500, 2000));
    program.slots.push_back(slot(OLS_DARK, 300, 4000));
    program.triggers[0].offset_ticks = -900;
    program.lead_ticks = 900;
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    expect_plays_to_the_end(program, *compiled.words);
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
    stage.run(3200 * 50 + SEQUENCE_LATCH_TICKS);
    program.cycles = 50;
    stage.played.resize(100);
    expect_plays_program(stage, program);
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
    for (uint64_t words = 1; words < compiled.words->event_count; words++) {
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
    const uint64_t all_words = compiled.words->slot_count * compiled.words->pattern_words;
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
        const uint32_t stated_ticks = sequence_shift_ticks(&program.board);
        // This interpreter shows each of the two flags a tick earlier than PIO; and one for the divided clock's phase.
        EXPECT_EQ(stated_ticks, taken_ticks + 3) << chain_bits << " bits";
    }
}

TEST(Sequence, the_shortest_period_that_is_accepted_plays) {
    // The shortest period that is accepted plays; its shift ends just before the sync asks for it.
    Program program;
    const uint32_t shortest_ticks = sequence_shift_ticks(&program.board) + sequence_slot_gap_ticks();
    program.slots = {slot(OLS_BASIS, 8, shortest_ticks),
                     slot(OLS_BASIS, shortest_ticks - sequence_slot_gap_ticks(), shortest_ticks)};
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
        EXPECT_EQ(compiled.words->slot_count, 0);
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
    EXPECT_EQ(refused(
                  [](Program& p) {
                      for (Slot& s : p.slots) s.header.period_ticks = 0xfffffff0;
                      p.slots.resize(1024, p.slots[0]);
                  },
                  "events"),
              15);
}

TEST(Sequence, a_program_for_another_chain_is_refused) {
    Program program;
    program.slots = {slot(OLS_BASIS, 1000, 3000)};
    const std::vector<uint8_t> bytes = program.bytes();
    ols_load_begin header{};
    header.slot_count = 1;
    header.chain_bits = 160;
    header.program_bytes = uint32_t(bytes.size());
    sequence words;
    ols_error_reply error{};
    EXPECT_FALSE(sequence_compile(&program.board, &header, bytes.data(), &words, &error));
    EXPECT_STREQ(error.text, "this board's chain has 176 bits: compile the program for that");
}

TEST(Sequence, a_full_program_of_1024_slots_fits) {
    Program program;
    for (int n = 0; n < OLS_SLOTS_MAX; n++) program.slots.push_back(slot(OLS_BASIS, 51'500, 57'870));
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    const size_t bytes = 4 * (compiled.words->event_count + compiled.words->slot_count * compiled.words->pattern_words);
    EXPECT_EQ(bytes, 1024 * 36 + 4) << "36 bytes a slot, and the end of the cycle";
}

TEST(Witness, counts_every_second_tick_in_every_path) {
    std::mt19937 random(6);
    PioBlock block;
    PioMachine witness{block, WITNESS_PROGRAM, WITNESS_WRAP_TARGET, WITNESS_WRAP};
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
