// SPDX-License-Identifier: MIT
// From sequence.toml's keys to the board's ticks, and into its messages.
#include "stage/playback.hpp"

#include <fmt/format.h>

#include <cmath>

namespace ols {

namespace {

constexpr uint8_t all_kinds = 1 << OLS_BASIS | 1 << OLS_TRACKING | 1 << OLS_MATTE | 1 << OLS_DARK;

// Bits of the kinds named; all of them without the key.
uint8_t read_kinds(TomlSection& table) {
    if (!table.has("kinds")) return all_kinds;
    const std::map<std::string, int> known = {
        {"basis", OLS_BASIS}, {"tracking", OLS_TRACKING}, {"matte", OLS_MATTE}, {"dark", OLS_DARK}};
    std::vector<std::string> names;
    table.read("kinds", names);
    uint8_t kinds = 0;
    for (const std::string& name : names) {
        if (!known.contains(name))
            table.reject("kinds", "names '" + name + "', which is none of: basis, dark, matte, tracking");
        else
            kinds |= uint8_t(1 << known.at(name));
    }
    return kinds;
}

void read_trigger(TomlSection table, Playback& playback, uint8_t& lines_read) {
    int line = 0;
    if (!table.has("line")) table.reject("line", "is missing: which of the board's lines, 0 to 3");
    table.read("line", line, 0, OLS_TRIGGERS - 1);
    if (lines_read >> line & 1) table.reject("line", fmt::format("{} has a table already", line));
    lines_read |= uint8_t(1 << line);
    TriggerLine& trigger = playback.triggers[size_t(line)];
    double offset_us = 0, width_us = 0;
    table.read("offset_us", offset_us, -1e6, 1e6);
    table.read("width_us", width_us, 0, 1e6);
    table.read("active_low", trigger.active_low);
    trigger.offset_ticks = int32_t(ticks_of_us(offset_us));
    trigger.width_ticks = uint32_t(ticks_of_us(width_us));
    trigger.skip_kinds = uint8_t(all_kinds & ~read_kinds(table));
}

}  // namespace

int64_t ticks_of_us(double us) {
    return std::llround(us * double(ticks_per_us));
}

Playback read_playback(TomlSection& file) {
    Playback playback;
    file.read_choice<StartSource>(
        "start", playback.start,
        {{"command", StartSource::command}, {"genlock", StartSource::genlock}, {"photo", StartSource::photo}});
    double debounce_us = double(playback.debounce_ticks) / double(ticks_per_us);
    double heartbeat_ms = double(playback.heartbeat_ticks) / double(ticks_per_us) / 1e3, lead_us = 0;
    if (file.has("debounce_us") && playback.start != StartSource::photo)
        file.reject("debounce_us", "is for start = \"photo\" only: remove it");
    file.read("debounce_us", debounce_us, 0.04, 1e6);
    file.read("heartbeat_ms", heartbeat_ms, 0, 30'000);
    if (heartbeat_ms != 0 && heartbeat_ms < 5) file.reject("heartbeat_ms", "must be 5 or more, or 0 for none");
    file.read("lead_us", lead_us, 0, 1e6);
    playback.debounce_ticks =
        uint32_t(2 * std::llround(debounce_us * double(ticks_per_us) / 2));  // even, says the board
    playback.heartbeat_ticks = uint32_t(ticks_of_us(heartbeat_ms * 1e3));
    playback.lead_ticks = uint32_t(ticks_of_us(lead_us));
    uint8_t lines_read = 0;
    for (auto& table : file.sections("trigger", OLS_TRIGGERS)) read_trigger(table, playback, lines_read);
    return playback;
}

void describe_triggers(const Playback& playback, ols_load_begin& begin) {
    begin.lead_ticks = playback.lead_ticks;
    for (size_t n = 0; n < playback.triggers.size(); ++n) {
        const TriggerLine& line = playback.triggers[n];
        begin.triggers[n] = {line.offset_ticks, line.width_ticks, line.skip_kinds, uint8_t(line.active_low), 0};
    }
}

ols_arm arm_message(const Playback& playback) {
    ols_arm arm{};
    arm.heartbeat_ticks = playback.heartbeat_ticks;
    arm.start_source = uint8_t(playback.start);
    if (playback.start == StartSource::photo) arm.debounce_ticks = playback.debounce_ticks;
    return arm;
}

}  // namespace ols
