// SPDX-License-Identifier: MIT
// What sequence.toml asks of the board: into its messages, and what it cannot ask.
// links: ols_stage
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "stage/sequence.hpp"

using namespace ols;

namespace {

Result<SequenceConfig> read(const std::string& text) {
    const auto path = std::filesystem::temp_directory_path() / ("playback" + std::to_string(getpid()) + ".toml");
    std::ofstream(path) << text;
    auto config = read_sequence(path);
    std::filesystem::remove(path);
    return config;
}

void expect_error(const std::string& text, const std::string& line, const std::string& what) {
    const auto config = read(text);
    ASSERT_FALSE(config.ok()) << text;
    EXPECT_NE(config.error().message.find(".toml:" + line + ": "), std::string::npos) << config.error().message;
    EXPECT_NE(config.error().message.find(what), std::string::npos) << config.error().message;
}

const std::string a_slot = "[[slot]]\nexposure_us = 100\n";

}  // namespace

TEST(Playback, without_keys_is_a_command_a_trigger_with_the_light_and_a_heartbeat_of_five_seconds) {
    const auto config = read("");
    ASSERT_TRUE(config.ok());
    const ols_arm arm = arm_message(config->playback);
    EXPECT_EQ(arm.start_source, OLS_START_BY_COMMAND);
    EXPECT_EQ(uint32_t(arm.heartbeat_ticks), 625'000'000u);
    EXPECT_EQ(uint32_t(arm.debounce_ticks), 0u);
    ols_load_begin begin{};
    describe_triggers(config->playback, begin);
    EXPECT_EQ(begin.lead_ticks, 0u);
    for (int n = 0; n < OLS_TRIGGERS; ++n) {
        const ols_trigger trigger = begin.triggers[n];
        EXPECT_EQ(trigger.offset_ticks, 0);
        EXPECT_EQ(trigger.width_ticks, 0u);
        EXPECT_EQ(trigger.skip_kinds, 0);
        EXPECT_EQ(trigger.active_low, 0);
    }
}

TEST(Playback, times_become_ticks_of_eight_nanoseconds_and_kinds_what_is_skipped) {
    const auto config = read(
        "start = \"photo\"\ndebounce_us = 0.1\nheartbeat_ms = 0\nlead_us = 2.5\n"
        "[[trigger]]\nline = 2\noffset_us = -1.004\nwidth_us = 4\nkinds = [\"tracking\", \"dark\"]\n"
        "active_low = true\n");
    ASSERT_TRUE(config.ok()) << config.error().message;
    const ols_arm arm = arm_message(config->playback);
    EXPECT_EQ(arm.start_source, OLS_START_EACH_CYCLE_BY_EDGE);
    EXPECT_EQ(uint32_t(arm.heartbeat_ticks), 0u);
    EXPECT_EQ(uint32_t(arm.debounce_ticks), 12u) << "12.5 ticks, made even";
    ols_load_begin begin{};
    describe_triggers(config->playback, begin);
    EXPECT_EQ(begin.lead_ticks, 313u);
    EXPECT_EQ(begin.triggers[2].offset_ticks, -126);  // 125.5, away from zero
    EXPECT_EQ(begin.triggers[2].width_ticks, 500u);
    EXPECT_EQ(begin.triggers[2].skip_kinds, 1 << OLS_BASIS | 1 << OLS_MATTE);
    EXPECT_EQ(begin.triggers[2].active_low, 1);
    EXPECT_EQ(begin.triggers[0].skip_kinds, 0);
}

TEST(Playback, what_cannot_be_played_is_an_error_that_names_line_and_key) {
    expect_error("start = \"light\"\n", "1", "none of: command, genlock, photo");
    expect_error("debounce_us = 5\n", "1", "debounce_us is for start = \"photo\" only");
    expect_error("heartbeat_ms = 2\n", "1", "heartbeat_ms must be 5 or more");
    expect_error("[[trigger]]\noffset_us = 1\n", "1", "trigger.line is missing");
    expect_error("[[trigger]]\nline = 4\n", "2", "trigger.line must be a whole number from 0 to 3");
    expect_error("[[trigger]]\nline = 1\n[[trigger]]\nline = 1\n", "4", "has a table already");
    expect_error("[[trigger]]\nline = 1\nkinds = [\"flash\"]\n", "3", "'flash', which is none of");
    expect_error("[[trigger]]\nline = 1\nkinds = 3\n", "3", "must be a list of at most 4096 texts");
    expect_error("basis = \"single\"\n" + a_slot, "2", "exclude each other");
    expect_error("[[slot]]\nkind = \"basis\"\n", "1", "slot.exposure_us is missing");
    expect_error(a_slot + "period_us = 90\n", "2", "does not fit the period of 90 us");
    expect_error(a_slot + "kind = \"dark\"\nlamps = [1]\n", "4", "must not be in a dark slot");
    expect_error(a_slot + "kind = \"basis\"\nlamps = [1, 2]\nlevels = [3]\n", "5", "lists 1 for 2 lamps");
    expect_error(a_slot + "planes = 4\n", "3", "planes is for slots with levels");
    expect_error(a_slot + "kind = \"basis\"\nplanes = 4\nlevels = [16]\n", "5", "from 0 to 15");
    expect_error("[harmonics]\norder = 1\n", "1", "harmonics is for basis");
    expect_error("basis = \"spherical_harmonics\"\n[harmonics]\norder = 11\n", "3", "from 0 to 10");
}

TEST(Playback, listed_slots_are_compiled_as_they_are) {
    auto config =
        read("frame_rate_hz = 1000\n[offset_us]\nbasis = -2\n" + a_slot +
             "kind = \"basis\"\nlamps = [161, 3]\nlevels = [5, 255]\noffset_us = 0.4\ntriggers = [1, 3]\n" + a_slot);
    ASSERT_TRUE(config.ok()) << config.error().message;
    const auto sequence = compile_sequence(*config, default_stage());
    ASSERT_TRUE(sequence.ok()) << sequence.error().message;
    EXPECT_FALSE(sequence->is_capture());
    ASSERT_EQ(sequence->slots.size(), 2u);
    const Slot& grey = sequence->slots[0];
    EXPECT_EQ(grey.levels[161], 5);
    EXPECT_EQ(grey.levels[3], 255);
    EXPECT_EQ(grey.exposure_ticks, 49u * 255) << "the nearest multiple of 255 ticks to 100 us";
    EXPECT_EQ(grey.period_ticks, 125'000u);
    EXPECT_EQ(grey.trigger_offset_ticks, 50 - 250);
    EXPECT_EQ(grey.trigger_mask, 0b1010);
    EXPECT_EQ(grey.light_ticks(161), 5 * 49.0);
    EXPECT_EQ(sequence->slots[1].kind, SlotKind::dark);
    EXPECT_EQ(sequence->slots[1].trigger_mask, 1) << "those of the stage's cameras";
    config = read(a_slot + "kind = \"basis\"\nlamps = [162]\n");
    ASSERT_TRUE(config.ok());
    EXPECT_NE(compile_sequence(*config, default_stage()).error().message.find("slot 0 names lamp 162"),
              std::string::npos);
}
