// SPDX-License-Identifier: MIT
// Playback: how the board is to play a sequence, apart from its slots: what starts it, when the cameras' triggers fire, and
// how long the host may be silent.
#pragma once

#include <array>
#include <cstdint>

#include "stage/toml_section.hpp"
#include "wire.h"

namespace ols {

constexpr uint64_t tick_hz = 125'000'000;  // the board's clock
constexpr uint64_t ticks_per_us = tick_hz / 1'000'000;

enum class StartSource : uint8_t {
    command = OLS_START_BY_COMMAND,
    genlock = OLS_START_BY_EDGE,           // a rise of GENLOCK
    photo = OLS_START_EACH_CYCLE_BY_EDGE,  // each cycle by an edge of the photo-receptor at GENLOCK
};

// One of the board's trigger lines (ols_trigger).
struct TriggerLine {
    int32_t offset_ticks = 0;  // from a slot's light, and the slot's own offset, to the rise
    uint32_t width_ticks = 0;  // 0: as long as the light
    uint8_t skip_kinds = 0;    // bit k: not in slots of kind k
    bool active_low = false;
};

struct Playback {
    StartSource start = StartSource::command;
    // A projector's picture takes milliseconds to change; a receptor bounces for microseconds.
    uint32_t debounce_ticks = 10 * ticks_per_us;  // of the photo-receptor
    // A host that was silent for 5 s has gone; a busy one that records reads the log many times a second.
    uint32_t heartbeat_ticks = 5 * tick_hz;
    uint32_t lead_ticks = 0;  // dark before a cycle's first light: room for triggers that lead it
    std::array<TriggerLine, OLS_TRIGGERS> triggers;
};

// Ticks nearest to a time that may be negative.
int64_t ticks_of_us(double us);

// The keys start, debounce_us, heartbeat_ms (0: none), lead_us, and the tables [[trigger]]; absent ones have the defaults
// above. What is wrong is noted in the file.
Playback read_playback(TomlSection& file);

// The parts of the board's messages that say so.
void describe_triggers(const Playback& playback, ols_load_begin& begin);
ols_arm arm_message(const Playback& playback);

}  // namespace ols
