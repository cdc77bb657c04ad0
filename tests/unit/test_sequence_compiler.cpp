// SPDX-License-Identifier: MIT
// The sequence compiler against the layout that Wenger section 4 gives, and its optical code against brute force.
// links: ols_stage
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <set>

#include "stage/flicker.hpp"
#include "stage/sequence.hpp"

using namespace ols;

namespace {

Sequence compile(const std::string& basis, double exposure_us = 100) {
    SequenceConfig config;
    config.basis = basis;
    config.basis_exposure_us = exposure_us;
    auto sequence = compile_sequence(config, default_stage());
    EXPECT_TRUE(sequence.ok()) << (sequence.ok() ? "" : sequence.error().message);
    return *sequence;
}

std::vector<SlotKind> kinds_of(const Sequence& sequence) {
    std::vector<SlotKind> kinds;
    for (const Slot& slot : sequence.slots) kinds.push_back(slot.kind);
    return kinds;
}

std::string error_of_file(const std::string& text) {
    const auto path = std::filesystem::temp_directory_path() / ("sequence" + std::to_string(getpid()) + ".toml");
    std::ofstream(path) << text;
    const auto read = read_sequence(path);
    std::filesystem::remove(path);
    return read.ok() ? "" : read.error().message;
}

}  // namespace

TEST(SequenceCompiler, every_basis_fills_the_180_slots_of_the_paper_and_shows_each_row_once) {
    for (const auto& [name, rows] : std::map<std::string, int>{{"single", 156}, {"s159", 159}, {"hadamard156", 156}}) {
        const Sequence sequence = compile(name);
        ASSERT_EQ(sequence.slots.size(), 180u) << name;
        std::map<SlotKind, int> count;
        std::set<int> seen;
        for (size_t s = 0; s < 180; ++s) {
            const Slot& slot = sequence.slots[s];
            ++count[slot.kind];
            EXPECT_EQ(slot.kind == SlotKind::tracking, s % 18 == 0);
            EXPECT_EQ(slot.kind == SlotKind::matte, s % 18 == 1);
            if (slot.kind == SlotKind::basis) seen.insert(slot.row);
            EXPECT_EQ(slot.period_ticks, 57870u);
        }
        EXPECT_EQ(count[SlotKind::tracking], 10) << name;
        EXPECT_EQ(count[SlotKind::matte], 10) << name;
        EXPECT_EQ(count[SlotKind::dark], 160 - rows) << name;
        EXPECT_EQ(int(seen.size()), rows) << name;
        EXPECT_EQ(*seen.rbegin(), rows - 1) << name;
    }
}

TEST(SequenceCompiler, a_slot_lights_the_lamps_of_its_kind) {
    const Sequence sequence = compile("s159");
    for (const Slot& slot : sequence.slots)
        for (int lamp = 0; lamp < 162; ++lamp) {
            const bool sphere = lamp < 156;
            const bool lit = slot.kind == SlotKind::tracking ? sphere
                             : slot.kind == SlotKind::matte  ? !sphere
                             : slot.kind == SlotKind::dark   ? false
                                                             : sphere && sequence.basis.lit(slot.row, lamp);
            ASSERT_EQ(slot.lit[size_t(lamp)] != 0, lit) << slot_kind_name(slot.kind) << " lamp " << lamp;
        }
}

TEST(SequenceCompiler, a_dark_slot_alone_tells_where_in_the_cycle_it_is) {
    for (const char* name : {"single", "s159", "hadamard156"}) {
        std::set<size_t> distances;
        size_t dark = 0;
        const auto kinds = kinds_of(compile(name));
        for (size_t s = 0; s < kinds.size(); ++s)
            if (kinds[s] == SlotKind::dark) ++dark, distances.insert(s % 18);
        EXPECT_GE(dark, 1u) << name;
        EXPECT_EQ(distances.size(), dark) << name;
    }
}

TEST(SequenceCompiler, an_order_that_a_rotation_repeats_is_found) {
    using enum SlotKind;
    EXPECT_TRUE(has_unique_order({tracking, matte, dark, basis}));
    EXPECT_FALSE(has_unique_order({tracking, matte, basis, tracking, matte, basis}));
    EXPECT_FALSE(has_unique_order({basis, basis, basis}));
    EXPECT_FALSE(has_unique_order({}));
    // Dark slots opposite each other: half a turn gives the same order.
    std::vector<SlotKind> opposite(36, basis);
    opposite[0] = opposite[18] = tracking;
    opposite[7] = opposite[25] = dark;
    EXPECT_FALSE(has_unique_order(opposite));
    opposite[25] = basis;
    opposite[26] = dark;
    EXPECT_TRUE(has_unique_order(opposite));
}

TEST(SequenceCompiler, the_length_follows_the_basis_and_the_group) {
    SequenceConfig config;
    for (const int group_slots : {3, 10, 18, 54, 200}) {
        config.group_slots = group_slots;
        const auto sequence = compile_sequence(config, default_stage());
        ASSERT_TRUE(sequence.ok());
        size_t dark = 0;
        for (const Slot& slot : sequence->slots) dark += slot.kind == SlotKind::dark;
        EXPECT_EQ(sequence->slots.size() % size_t(group_slots), 0u);
        EXPECT_GE(dark, 1u);
        EXPECT_LE(dark, size_t(group_slots - 2));
    }
}

TEST(SequenceCompiler, the_program_bytes_are_slots_and_patterns_most_significant_bit_first) {
    StageConfig stage = default_stage();
    stage.chain_bit_of_lamp[3] = 175;  // the last bit of the last word's upper half
    SequenceConfig config;
    const auto sequence = compile_sequence(config, stage);
    ASSERT_TRUE(sequence.ok());
    const auto bytes = encode_program(*sequence, stage);
    const size_t record = 16, pattern_bytes = 6 * 4;  // all slots first, then all patterns
    ASSERT_EQ(bytes.size(), 180 * (record + pattern_bytes));
    for (size_t s = 0; s < 180; ++s) {
        const Slot& slot = sequence->slots[s];
        EXPECT_EQ(bytes[s * record], uint8_t(slot.kind));
        EXPECT_EQ(bytes[s * record + 1], 1);
        uint32_t exposure_ticks, period_ticks;
        std::memcpy(&exposure_ticks, &bytes[s * record + 4], 4);
        std::memcpy(&period_ticks, &bytes[s * record + 8], 4);
        EXPECT_EQ(period_ticks, 57870u);
        EXPECT_EQ(exposure_ticks, slot.kind == SlotKind::tracking ? 50u * 125 : 412u * 125);
        if (slot.kind != SlotKind::basis) continue;
        // A single-lamp row sets one bit: lamp i's, in word i / 32, counted from the top.
        const int lamp = slot.row;
        const int bit = lamp == 3 ? 175 : lamp;
        for (int b = 0; b < 192; ++b) {
            uint32_t word;
            std::memcpy(&word, &bytes[180 * record + s * pattern_bytes + size_t(b / 32) * 4], 4);
            ASSERT_EQ(word >> (31 - b % 32) & 1, b == bit ? 1u : 0u);
        }
    }
}

TEST(SequenceCompiler, what_cannot_be_played_is_refused_with_a_remedy) {
    StageConfig stage = default_stage();
    SequenceConfig config;
    config.basis_exposure_us = 463;
    EXPECT_NE(compile_sequence(config, stage).error().message.find("does not fit"), std::string::npos);
    config = {};
    config.tracking_lamps = {5, 162};
    EXPECT_NE(compile_sequence(config, stage).error().message.find("lamp 162"), std::string::npos);
    config = {};
    config.basis = "hadamard156";
    stage.lamps.resize(20);
    EXPECT_NE(compile_sequence(config, stage).error().message.find("156 lamps"), std::string::npos);
    EXPECT_NE(error_of_file("basis = \"none\"\n").find("none"), std::string::npos);
    EXPECT_NE(error_of_file("cycles = 0\n").find("cycles must be"), std::string::npos);
    EXPECT_NE(error_of_file("[exposure_us]\nbases = 1\n").find(":2: exposure_us.bases"), std::string::npos);
    EXPECT_NE(error_of_file("frame_rate_hz = 5000\n").find("does not fit"), std::string::npos);
}

TEST(SequenceCompiler, the_examples_compile) {
    for (const char* name : {"single", "s159", "hadamard156"}) {
        const auto config = read_sequence(std::string("examples/sequence_") + name + ".toml");
        ASSERT_TRUE(config.ok()) << config.error().message;
        EXPECT_EQ(config->basis, name);
        EXPECT_TRUE(compile_sequence(*config, default_stage()).ok());
    }
}

TEST(Flicker, a_single_lamp_flashes_once_a_cycle_beside_its_tracking) {
    SequenceConfig config;
    config.tracking_lamps = {0};
    const auto sequence = compile_sequence(config, default_stage());
    const Flicker flicker = measure_flicker(*sequence);
    const double cycle_us = 180 * 57870 / 125.0;
    EXPECT_NEAR(flicker.lamps[5].strobe_hz, 1e6 / cycle_us, 1e-6);
    EXPECT_NEAR(flicker.lamps[5].duty, 412 / cycle_us, 1e-9);
    EXPECT_NEAR(flicker.lamps[5].longest_dark_us, cycle_us - 412, 1e-6);
    EXPECT_NEAR(flicker.lamps[0].strobe_hz, 11e6 / cycle_us, 1e-6);
    // One flash a cycle has every harmonic at twice the mean.
    EXPECT_NEAR(flicker.worst_lamp.modulation, 2, 1e-9);
}

TEST(Flicker, a_sine_of_light_is_measured_at_its_own_frequency_and_amplitude) {
    const Sequence sequence = compile("single");
    std::vector<double> light;
    for (int s = 0; s < 180; ++s) light.push_back(10 + 3 * std::cos(2 * std::numbers::pi * 2 * s / 180));
    const FlickerPeak peak = find_flicker(sequence, light);
    EXPECT_NEAR(peak.hz, 2 * 125e6 / (180 * 57870.0), 1e-6);
    EXPECT_NEAR(peak.modulation, 0.3, 1e-9);
    EXPECT_EQ(find_flicker(sequence, std::vector<double>(180, 0)).modulation, 0);
    // 120 flashes a second, evenly: nothing in the band.
    std::vector<double> even(180, 0);
    for (int s = 0; s < 180; s += 18) even[size_t(s)] = 1;
    EXPECT_LT(find_flicker(sequence, even).modulation, 1e-12);
}
