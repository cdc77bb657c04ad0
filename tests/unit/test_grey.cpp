// SPDX-License-Identifier: MIT
// Grey levels by binary-coded modulation: the light that each lamp gets in a slot, added up from the pins.
// links: ols_firmware
#include "sequence_player.hpp"

using namespace ols::test;

namespace {

constexpr uint32_t period_ticks = 57'870;  // 2160 slots/s
constexpr uint32_t unit_ticks = 200;

// Lamp b has level first_level + b, as far as 8 bits go.
Slot ramp_slot(int first_level, uint32_t unit = unit_ticks) {
    Slot made = slot(OLS_BASIS, 255 * unit, period_ticks, 6 * 8);
    made.header.planes = 8;
    for (int lamp = 0; lamp < 176; lamp++)
        for (int plane = 0; plane < 8; plane++)
            made.pattern[size_t(6 * plane + lamp / 32)] |= uint32_t((first_level + lamp) >> (7 - plane) & 1)
                                                           << (31 - lamp % 32);
    return made;
}

std::vector<int64_t> light_of_lamps(const Stage& stage, size_t first, size_t end) {
    std::vector<int64_t> ticks(176, 0);
    for (size_t n = first; n < end; n++)
        for (size_t lamp = 0; lamp < ticks.size(); lamp++)
            if (stage.played[n].lamps[lamp]) ticks[lamp] += stage.played[n].light.fall - stage.played[n].light.rise;
    return ticks;
}

TEST(Grey, every_one_of_256_levels_gets_its_light_to_the_tick_at_2160_slots_a_second) {
    Program program;
    program.slots = {ramp_slot(0), ramp_slot(80)};
    program.cycles = 2;
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    Stage stage(program, *compiled.words);
    stage.arm();
    stage.run(5 * period_ticks);
    expect_plays_program(stage, program);
    std::vector<bool> seen(256, false);
    for (size_t n = 0; n < 4; n++) {
        const std::vector<int64_t> ticks = light_of_lamps(stage, 8 * n, 8 * n + 8);
        for (int lamp = 0; lamp < 176; lamp++) {
            const int level = (n % 2 ? 80 : 0) + lamp;
            EXPECT_EQ(ticks[size_t(lamp)], level * int64_t(unit_ticks)) << "level " << level;
            seen[size_t(level)] = true;
        }
    }
    EXPECT_EQ(std::count(seen.begin(), seen.end(), true), 256);
}

TEST(Grey, the_longest_unit_that_fits_2160_slots_a_second_is_217_ticks) {
    Program program;
    program.slots = {ramp_slot(0, 217)};
    EXPECT_TRUE(compile(program).ok);
    program.slots = {ramp_slot(0, 218)};
    EXPECT_FALSE(compile(program).ok);
    // At half the shift clock, for drivers or wiring of 10 MHz, five planes are shorter than a shift.
    program.board.shift_divider = 2;
    program.slots = {ramp_slot(0, 193)};
    EXPECT_TRUE(compile(program).ok) << compile(program).error.text;
}

TEST(Grey, three_hundred_slots_fit_each_of_the_two_sequences) {
    Program program;
    program.slots.assign(300, ramp_slot(0));
    const Compiled compiled = compile(program);
    ASSERT_TRUE(compiled.ok) << compiled.error.text;
    EXPECT_LE(compiled.word_count(), uint32_t(SEQUENCE_WORDS_MAX));
}

TEST(Grey, on_off_and_grey_slots_of_any_depth_share_a_program) {
    std::mt19937 random(8);
    for (int repeat = 0; repeat < 20; repeat++) {
        Program program = random_program(random, 40, 1 + int(random() % 6));
        program.cycles = 2;
        const Compiled compiled = compile(program);
        ASSERT_TRUE(compiled.ok) << compiled.error.text;
        expect_plays_to_the_end(program, *compiled.words);
    }
}

TEST(Grey, what_cannot_be_grey_is_refused_with_its_slot) {
    const auto refused = [](auto change, const char* reason) {
        Program program;
        program.slots = {ramp_slot(0), ramp_slot(0)};
        change(program.slots[1]);
        const Compiled compiled = compile(program);
        EXPECT_FALSE(compiled.ok);
        EXPECT_NE(std::string(compiled.error.text).find(reason), std::string::npos) << compiled.error.text;
        return compiled.error.slot;
    };
    EXPECT_EQ(refused([](Slot& s) { s.header.exposure_ticks++; }, "multiple of 255"), 1);
    EXPECT_EQ(refused([](Slot& s) { s.header.exposure_ticks = 255 * 7; }, "at least 2040"), 1);
    EXPECT_EQ(refused([](Slot& s) { s.header.kind = OLS_DARK; }, "none in a dark slot"), 1);
    EXPECT_EQ(refused([](Slot& s) { s.pattern.back() = 1; }, "past the end of the chain"), 1);
    EXPECT_EQ(refused([](Slot& s) { s.header.planes = 9, s.pattern.resize(54); }, "planes are 9"), 1);
    EXPECT_EQ(refused([](Slot& s) { s.header.planes = 7; }, "has 392 bytes"), OLS_NO_SLOT);
}

}  // namespace
