// SPDX-License-Identifier: MIT
// Where the compiler of programs draws its lines: the last value that is accepted, the first that is refused, and the
// code, slot and figures of the refusal, each by the rules of PROTOCOL.md.
// links: ols_firmware
#include "sequence_player.hpp"

using namespace ols::test;

namespace {

constexpr uint32_t gap_ticks = 28;  // latch 12, wait 8, end of the cycle 8

template <typename Change>
Program changed(Change change) {
    Program program;
    for (int n = 0; n < 4; n++) program.slots.push_back(slot(OLS_BASIS, 1000, 3000));
    change(program);
    return program;
}

template <typename Change>
void expect_accepted(Change change) {
    const Compiled compiled = compile(changed(change));
    EXPECT_TRUE(compiled.ok) << compiled.error.text;
}

template <typename Change>
void expect_refused(Change change, int slot, const std::string& text, int code = OLS_ERROR_BAD_PROGRAM) {
    const Compiled compiled = compile(changed(change));
    ASSERT_FALSE(compiled.ok) << "but for: " << text;
    EXPECT_EQ(compiled.error.code, code);
    EXPECT_EQ(compiled.error.slot, slot);
    EXPECT_EQ(compiled.error.text, text);
}

TEST(SequenceLimits, a_chain_of_any_length_lights_its_last_lamp_and_no_further_one) {
    for (uint16_t bits = 1; bits <= OLS_CHAIN_BITS_MAX; bits++) {
        const auto with_bit = [bits](int bit) {
            return [bits, bit](Program& p) {
                p.board.chain_bits = bits;
                p.slots = {slot(OLS_BASIS, 5000, 6000, (bits + 31) / 32)};
                p.slots[0].pattern[size_t(bit / 32)] = 1u << (31 - bit % 32);
            };
        };
        expect_accepted(with_bit(bits - 1));
        if (bits % 32 == 0) continue;
        expect_refused(with_bit(bits), 0,
                       "slot 0: a pattern has bits past the end of the chain of " + std::to_string(bits) + " bits");
    }
}

TEST(SequenceLimits, no_bit_of_a_dark_slot_may_be_lit) {
    for (int bit = 0; bit < 176; bit++)
        expect_refused(
            [bit](Program& p) {
                p.slots[1].header.kind = OLS_DARK;
                p.slots[1].pattern[size_t(bit / 32)] = 1u << (31 - bit % 32);
            },
            1, "slot 1: a dark slot must have an empty pattern of 176 zeros");
}

TEST(SequenceLimits, a_dark_slot_has_one_plane_and_others_eight_at_most) {
    expect_accepted([](Program& p) { p.slots[0].header.kind = OLS_DARK, p.slots[0].header.planes = 1; });
    expect_refused(
        [](Program& p) {
            p.slots[0].header.kind = OLS_DARK, p.slots[0].header.planes = 2;
            p.slots[0].pattern.resize(12);
        },
        0, "slot 0: its planes are 2: 8 at most, and none in a dark slot");
    const auto grey = [](uint8_t planes) {
        return [planes](Program& p) {
            p.slots[3] = slot(OLS_BASIS, 8u * ((1u << planes) - 1), 57'870, 6 * planes);
            p.slots[3].header.planes = planes;
        };
    };
    expect_accepted(grey(8));
    expect_refused(grey(9), 3, "slot 3: its planes are 9: 8 at most, and none in a dark slot");
}

TEST(SequenceLimits, exposures_and_periods) {
    expect_accepted([](Program& p) { p.slots[2].header.exposure_ticks = 8; });
    expect_refused([](Program& p) { p.slots[2].header.exposure_ticks = 7; }, 2,
                   "slot 2: exposure must be at least 8 ticks");
    expect_accepted([](Program& p) { p.slots[2].header.exposure_ticks = 3000 - gap_ticks; });
    expect_refused([](Program& p) { p.slots[2].header.exposure_ticks = 3001 - gap_ticks; }, 2,
                   "slot 2: period must exceed the exposure by at least 28 ticks");
    expect_refused([](Program& p) { p.slots[2].header.period_ticks = gap_ticks; }, 2,
                   "slot 2: period must exceed the exposure by at least 28 ticks");
    const Program program;
    const uint32_t shortest_ticks = slot_shift_ticks(&program.board) + gap_ticks;
    expect_accepted([&](Program& p) { p.slots[2].header.period_ticks = shortest_ticks; });
    expect_refused(
        [&](Program& p) { p.slots[2].header.period_ticks = shortest_ticks - 1; }, 2,
        "slot 2: period must be at least " + std::to_string(shortest_ticks) + " ticks, to send the next pattern");
    const auto grey_exposure = [](uint32_t ticks) {
        return [ticks](Program& p) {
            p.slots[1] = slot(OLS_BASIS, ticks, 57'870, 6 * 3);
            p.slots[1].header.planes = 3;
        };
    };
    expect_accepted(grey_exposure(56));
    expect_refused(grey_exposure(55), 1, "slot 1: exposure must be at least 56 ticks");
    expect_refused(grey_exposure(57), 1, "slot 1: the exposure of a grey slot must be a multiple of 7 ticks");
}

TEST(SequenceLimits, each_field_of_each_trigger_by_itself) {
    for (int n = 0; n < OLS_TRIGGERS; n++) {
        const std::string text =
            "trigger " + std::to_string(n) + ": skip_kinds is 15 at most, active_low 1, reserved 0";
        expect_accepted([n](Program& p) { p.triggers[n] = {0, 8, 15, 1, 0}; });
        expect_refused([n](Program& p) { p.triggers[n].skip_kinds = 16; }, OLS_NO_SLOT, text);
        expect_refused([n](Program& p) { p.triggers[n].active_low = 2; }, OLS_NO_SLOT, text);
        expect_refused([n](Program& p) { p.triggers[n].reserved = 1; }, OLS_NO_SLOT, text);
        expect_refused([n](Program& p) { p.triggers[n].width_ticks = 7; }, OLS_NO_SLOT,
                       "trigger widths must be 0 or at least 8 ticks");
    }
}

TEST(SequenceLimits, slots_and_cycles) {
    expect_accepted([](Program& p) { p.cycles = OLS_CYCLES_MAX; });
    expect_refused([](Program& p) { p.cycles = OLS_CYCLES_MAX + 1; }, OLS_NO_SLOT,
                   "a program counts 524288 cycles at most: send 0 for endless");
    expect_accepted([](Program& p) { p.slots.resize(1); });
    expect_refused([](Program& p) { p.slots.clear(); }, OLS_NO_SLOT, "a program has 1 to 1024 slots");
    expect_refused([](Program& p) { p.slots.resize(1025, p.slots[0]); }, OLS_NO_SLOT, "a program has 1 to 1024 slots");
    expect_refused(
        [](Program& p) {
            for (Slot& s : p.slots) s.pattern.clear();
        },
        OLS_NO_SLOT, "a program of such slots has 160 bytes");
}

// 4 words a slot and 6 a plane: 461 slots of 8 planes and 2 of 7 are the board's 24064 words.
TEST(SequenceLimits, a_program_as_long_as_the_memory_leaves_no_room_for_its_events) {
    expect_refused(
        [](Program& p) {
            Slot grey = slot(OLS_BASIS, 255 * 8, 57'870, 6 * 8);
            grey.header.planes = 8;
            p.slots.assign(463, grey);
            for (int n = 0; n < 2; n++) {
                p.slots[size_t(n)].header.planes = 7;
                p.slots[size_t(n)].pattern.resize(6 * 7);
            }
        },
        OLS_NO_SLOT, "the program is longer than the board's 96256 bytes: send fewer slots");
}

// Waits beyond what one event plays take a word more, long lights and waits several: 1024 slots fill the memory to the
// word.
TEST(SequenceLimits, words_up_to_the_last_one_are_used) {
    const auto filled = [](size_t long_slots, size_t longer_slots) {
        return changed([=](Program& p) {
            p.slots.assign(OLS_SLOTS_MAX, slot(OLS_BASIS, 51'500, 57'870, 6, 15));
            for (int n = 0; n < OLS_TRIGGERS; n++) p.triggers[n] = {100 * (n + 1), 1000u * uint32_t(n + 1), 0, 0, 0};
            for (size_t n = 0; n < long_slots; n++) {
                p.slots[n].header.exposure_ticks = 20'000'000;
                p.slots[n].header.period_ticks = 60'000'000;
            }
            const uint32_t one_word_more_ticks = 12 + 51'500 + (1 << 19) + 8;
            for (size_t n = 0; n < longer_slots; n++) p.slots[long_slots + n].header.period_ticks = one_word_more_ticks;
        });
    };
    const uint32_t plain = compile(filled(0, 0)).word_count();
    const uint32_t each = compile(filled(1, 0)).word_count() - plain;
    ASSERT_EQ(compile(filled(0, 1)).word_count() - plain, 1u);
    constexpr uint32_t most = SEQUENCE_WORDS_MAX - 1;  // one more waits for an edge
    const size_t long_slots = (most - plain) / each - 5;
    const size_t left = most - plain - long_slots * each;
    const Compiled fits = compile(filled(long_slots, left));
    ASSERT_TRUE(fits.ok) << fits.error.text;
    EXPECT_EQ(fits.word_count(), most);
    const Compiled over = compile(filled(long_slots, left + 1));
    EXPECT_FALSE(over.ok);
    EXPECT_EQ(over.error.slot, OLS_SLOTS_MAX - 1) << "it is the cycle's end that does not fit";
    EXPECT_STREQ(over.error.text,
                 "slot 1023: program and events need more than the board's 96256 bytes: send fewer slots");
}

TEST(SequenceLimits, the_lead_comes_from_the_dark_end_of_the_last_slot) {
    const Program program;
    const uint32_t room_ticks = 3000 - gap_ticks - slot_shift_ticks(&program.board);
    expect_accepted([&](Program& p) { p.lead_ticks = room_ticks; });
    expect_refused([&](Program& p) { p.lead_ticks = room_ticks + 1; }, 3,
                   "slot 3: its dark end leaves room for lead_ticks of " + std::to_string(room_ticks) +
                       ": end the cycle with a longer or a dark slot");
    expect_accepted([](Program& p) { p.lead_ticks = 8; });
    expect_refused([](Program& p) { p.lead_ticks = 7; }, OLS_NO_SLOT, "lead_ticks must be 0 or at least 8");
}

TEST(SequenceLimits, a_trigger_may_rise_with_the_cycle_and_not_before) {
    const auto offset = [](int32_t ticks) {
        return [ticks](Program& p) { p.lead_ticks = 100, p.slots[0].header.trigger_offset_ticks = ticks; };
    };
    expect_accepted(offset(-112));
    expect_refused(offset(-113), 0, "slot 0: a trigger begins before the cycle: raise lead_ticks by 1 or more");
}

TEST(SequenceLimits, a_trigger_may_fall_with_the_end_of_the_cycle_and_not_after) {
    // The cycle's end begins 8 + 12 ticks before the next cycle's light.
    const auto offset = [](int32_t ticks) {
        return [ticks](Program& p) { p.slots[3].header.trigger_offset_ticks = ticks; };
    };
    expect_accepted(offset(3000 - 20 - 1000));
    expect_refused(offset(3000 - 20 - 1000 + 8), 3,
                   "slot 3: its pulse of trigger 0 ends after the cycle: end the cycle with a longer slot");
}

TEST(SequenceLimits, pulses_of_a_trigger_are_eight_ticks_apart) {
    const auto offset = [](int32_t ticks) {
        return [ticks](Program& p) { p.slots[1].header.trigger_offset_ticks = ticks; };
    };
    expect_accepted(offset(1000 - 3000 + 8));
    expect_refused(offset(1000 - 3000 + 7), 1, "slot 1: its pulse overlaps an earlier one of trigger 0");
}

// LATCH is read by the drivers at its rise, but a long one would let a shift through.
TEST(SequenceLimits, latch_is_as_long_in_dark_slots_as_in_others) {
    std::mt19937 random(3);
    for (int repeat = 0; repeat < 20; repeat++) {
        const Program program = random_program(random, 176, 12);
        const Compiled compiled = compile(program);
        ASSERT_TRUE(compiled.ok) << compiled.error.text;
        Stage stage(program, *compiled.words);
        stage.arm();
        int high = 0;
        while (!stage.ended()) {
            stage.tick();
            const bool latch = stage.block.pins >> LATCH & 1;
            if (!latch && high > 0) {
                ASSERT_EQ(high, SLOT_LATCH_TICKS);
            }
            high = latch ? high + 1 : 0;
        }
    }
}

TEST(SequenceLimits, the_supplys_limit_holds_for_every_plane) {
    for (size_t plane = 0; plane < 8; plane++) {
        const auto lamps = [plane](int count) {
            return [=](Program& p) {
                p.board.limits.lamps_lit_max = 40;
                p.slots[2] = slot(OLS_BASIS, 255 * 8, 57'870, 6 * 8);
                p.slots[2].header.planes = 8;
                for (int bit = 0; bit < count; bit++)
                    p.slots[2].pattern[6 * plane + size_t(bit / 32)] |= 1u << (31 - bit % 32);
            };
        };
        expect_accepted(lamps(40));
        expect_refused(lamps(41), 2, "slot 2: this board's supply lights 40 lamps at once", OLS_ERROR_OVER_LIMIT);
    }
}

TEST(SequenceLimits, a_lamp_may_be_lit_for_its_share_of_the_cycle_to_the_tick) {
    // Chain bit 77 is lit in all four slots: 750 permille of 12 000 ticks are 9000.
    const auto last_exposure = [](uint32_t ticks) {
        return [ticks](Program& p) {
            p.board.limits.lamp_duty_max_permille = 750;
            for (Slot& s : p.slots) s.header.exposure_ticks = 2250, s.pattern[2] = 1u << (31 - 77 % 32);
            p.slots[3].header.exposure_ticks = ticks;
        };
    };
    expect_accepted(last_exposure(2250));
    expect_refused(last_exposure(2251), OLS_NO_SLOT,
                   "a lamp is lit for more of the cycle than its limit; chain bit 77: make the exposures shorter",
                   OLS_ERROR_OVER_LIMIT);
    // A grey level counts by all its planes: level 5 of 7.
    const auto grey_exposure = [](uint32_t unit_ticks, uint16_t permille) {
        return [=](Program& p) {
            p.board.limits.lamp_duty_max_permille = permille;
            p.slots = {slot(OLS_BASIS, 7 * unit_ticks, 50'000, 6 * 3)};
            p.slots[0].header.planes = 3;
            p.slots[0].pattern[0] = p.slots[0].pattern[12] = 1u << 31;
        };
    };
    expect_accepted(grey_exposure(5000, 500));
    expect_refused(grey_exposure(5000, 499), OLS_NO_SLOT,
                   "a lamp is lit for more of the cycle than its limit; chain bit 0: make the exposures shorter",
                   OLS_ERROR_OVER_LIMIT);
}

}  // namespace
