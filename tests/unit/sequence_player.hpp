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
    std::vector<uint32_t> pattern;  // of all planes, one after the other

    size_t planes() const { return std::max<size_t>(1, header.planes); }
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
    if (!bytes.empty() && bytes.size() <= sizeof result.words->words)
        std::memcpy(result.words->words, bytes.data(), bytes.size());
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

// One plane, or a slot's only pattern: what happens when, in ticks since the slot's first light.
struct Flash {
    int64_t latch, on, off, sent;
};

// By the rules of PROTOCOL.md, "Grey levels".
inline std::vector<Flash> flashes(const Program& program, const Slot& slot) {
    const int64_t shift = slot_shift_ticks(&program.board), planes = int64_t(slot.planes());
    std::vector<Flash> all;
    int64_t on = 0;
    for (int64_t plane = 0; plane < planes; plane++) {
        const int64_t unit = slot.header.exposure_ticks / ((1 << planes) - 1);
        const int64_t lit = slot.header.kind == OLS_DARK ? 8 : unit * (1 << (planes - 1 - plane));
        const int64_t sent = on + (lit >= shift ? lit : std::max(lit + 8, shift));
        all.push_back({on - SLOT_LATCH_TICKS, on, on + lit, sent});
        on = sent + 8 + SLOT_LATCH_TICKS;
    }
    return all;
}

// Up to `planes_max` planes in some of the slots.
inline Program random_program(std::mt19937& random, uint16_t chain_bits, int slot_count, int planes_max = 8) {
    Program program;
    program.board.chain_bits = chain_bits;
    const int words = (chain_bits + 31) / 32;
    const uint32_t shift_ticks = slot_shift_ticks(&program.board), gap_ticks = slot_gap_ticks();
    for (int n = 0; n < slot_count; n++) {
        const uint32_t spare_ticks = random() % 3 ? random() % 2000 : 0;
        Slot made = slot(ols_slot_kind(random() % 4), 16 + random() % 4000, 0, words, uint8_t(random() % 16));
        const bool dark = made.header.kind == OLS_DARK;
        if (random() % 3 == 0 && !dark) made.header.planes = uint8_t(random() % uint32_t(planes_max + 1));
        const uint32_t units = (1u << made.planes()) - 1;
        if (units > 1) made.header.exposure_ticks = units * (8 + random() % 200);
        made.pattern.assign(size_t(words) * made.planes(), 0);
        for (size_t plane = 0; plane < made.planes() && !dark; plane++)
            for (int bit = 0; bit < chain_bits; bit++)
                made.pattern[plane * size_t(words) + size_t(bit / 32)] |= uint32_t(random() & 1) << (31 - bit % 32);
        const uint32_t busy_ticks = uint32_t(flashes(program, made).back().sent);
        made.header.period_ticks =
            std::max({busy_ticks, shift_ticks, made.header.exposure_ticks}) + gap_ticks + spare_ticks;
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
            const bool dark = slot.header.kind == OLS_DARK;
            const int64_t span = dark ? slot.header.exposure_ticks : flashes(program, slot).back().off;
            pulses.push_back({rise, rise + (trigger.width_ticks ? trigger.width_ticks : span)});
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
    ASSERT_FALSE(stage.played.empty());
    const int64_t first_light = stage.played[0].latch + SLOT_LATCH_TICKS;
    const size_t words = (program.board.chain_bits + 31u) / 32;
    int64_t light = first_light;
    size_t at = 0;  // in what was played
    for (size_t n = 0; n < program.slots.size() * program.cycles; n++) {
        const Slot& slot = program.slots[n % program.slots.size()];
        const bool lit = slot.header.kind != OLS_DARK;
        const std::vector<Flash> planes = flashes(program, slot);
        for (size_t plane = 0; plane < planes.size(); plane++) {
            const Flash& flash = planes[plane];
            SCOPED_TRACE("slot " + std::to_string(n) + ", pattern " + std::to_string(at));
            ASSERT_LT(at, stage.played.size());
            const Stage::Played& played = stage.played[at++];
            EXPECT_EQ(played.latch, light + flash.latch);
            EXPECT_EQ(played.light, lit ? (Pulse{light + flash.on, light + flash.off}) : (Pulse{0, 0}));
            EXPECT_EQ(played.sync, n % program.slots.size() == 0);
            ASSERT_EQ(played.lamps.size(), program.board.chain_bits);
            for (int bit = 0; bit < program.board.chain_bits; bit++)
                ASSERT_EQ(played.lamps[bit], bit_of(slot.pattern, int(plane * words) * 32 + bit)) << "bit " << bit;
        }
        light += slot.header.period_ticks;
    }
    EXPECT_EQ(at, stage.played.size());
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
