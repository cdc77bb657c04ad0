// SPDX-License-Identifier: MIT
// Programs, the firmware's compiled words for them, and what an interpreter of the PIO programs makes of those: the
// common ground of the tests of sequences and triggers.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "pio_interpreter.hpp"
#include "pulse.h"
#include "sequence.h"

namespace ols::test {

struct Slot {
    ols_slot header{};
    std::vector<uint32_t> pattern;
};

struct Program {
    sequence_board board{176, 1, {OLS_CHAIN_BITS_MAX, 1000}};
    uint32_t cycles = 1;
    uint32_t lead_ticks = 0;
    ols_trigger triggers[OLS_TRIGGERS]{};
    std::vector<Slot> slots;

    // As loaded: the slots, then their patterns.
    std::vector<uint8_t> bytes() const {
        std::vector<uint8_t> all;
        const auto append = [&](const void* from, size_t count) {
            const auto* first = static_cast<const uint8_t*>(from);
            all.insert(all.end(), first, first + count);
        };
        for (const Slot& slot : slots) append(&slot.header, sizeof slot.header);
        for (const Slot& slot : slots) append(slot.pattern.data(), slot.pattern.size() * 4);
        return all;
    }
};

struct Compiled {
    bool ok = false;
    std::unique_ptr<sequence> words = std::make_unique<sequence>();
    ols_error_reply error{};

    uint32_t word_count() const { return words->header.program_bytes / 4 + 1 + words->cycle_words; }
};

inline Compiled compile(const Program& program) {
    const std::vector<uint8_t> bytes = program.bytes();
    Compiled result;
    ols_load_begin& header = result.words->header;
    header.slot_count = uint16_t(program.slots.size());
    header.chain_bits = program.board.chain_bits;
    header.cycles = program.cycles;
    header.program_bytes = uint32_t(bytes.size());
    header.lead_ticks = program.lead_ticks;
    std::copy(std::begin(program.triggers), std::end(program.triggers), header.triggers);
    if (bytes.size() <= sizeof result.words->words) std::memcpy(result.words->words, bytes.data(), bytes.size());
    sequence_compiler compiler;
    sequence_begin(&compiler, &program.board, result.words.get());
    sequence_progress progress;
    do progress = sequence_step(&compiler, &result.error);
    while (progress == SEQUENCE_UNFINISHED);
    result.ok = progress == SEQUENCE_MADE;
    return result;
}

inline bool bit_of(const std::vector<uint32_t>& words, int bit) {
    return words[bit / 32] >> (31 - bit % 32) & 1;
}

inline Slot slot(ols_slot_kind kind, uint32_t exposure_ticks, uint32_t period_ticks, int words = 6,
                 uint8_t trigger_mask = 1) {
    Slot made;
    made.header.kind = uint8_t(kind);
    made.header.trigger_mask = trigger_mask;
    made.header.exposure_ticks = exposure_ticks;
    made.header.period_ticks = period_ticks;
    made.pattern.assign(size_t(words), 0);
    return made;
}

inline Program random_program(std::mt19937& random, uint16_t chain_bits, int slot_count) {
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

struct Pulse {
    int64_t rise, fall;
    bool operator==(const Pulse&) const = default;
};

// What trigger n does in one cycle, from the program alone: ticks since the light of slot 0.
inline std::vector<Pulse> trigger_pulses(const Program& program, int n) {
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

inline uint64_t cycle_ticks(const Program& program) {
    uint64_t ticks = 0;
    for (const Slot& slot : program.slots) ticks += slot.header.period_ticks;
    return ticks;
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
        timeline.table.assign(sequence_enter(&words) + 1, sequence_enter(&words) + 1 + words.cycle_words);
        timeline.y = words.header.cycles - 1;
        shifter.side_bits = 1;
        shifter.side_pin = CLK;
        shifter.out_pin = DATA;
        shifter.out_count = 1;
        shifter.status_below = words.pattern_words;
        shifter.isr = program.board.chain_bits - 1u;
        shifter.table.assign(sequence_patterns(&words), sequence_patterns(&words) + sequence_patterns_words(&words));
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

inline void expect_plays_program(const Stage& stage, const Program& program) {
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

inline void expect_plays_to_the_end(const Program& program, const sequence& words) {
    Stage stage(program, words);
    stage.arm();
    stage.run(20'000'000);
    EXPECT_EQ(stage.block.flags & 7, 1u << 1) << "ends by having played all cycles";
    EXPECT_EQ(stage.block.pins & 0xff, 0u);
    expect_plays_program(stage, program);
}

}  // namespace ols::test
