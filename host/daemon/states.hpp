// SPDX-License-Identifier: MIT
// States: what the daemon is doing, and the one table of what each state allows.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace ols {

enum class DaemonState {
    idle,        // dark; devices are held and looked at
    armed,       // the board has the program, cameras are set up, the disk has room: light comes at once
    recording,   // the board plays, or is about to (a take or a calibration)
    processing,  // dark, by the board's own word; frames in memory are still being developed and written
    fault        // dark; why stands beside it, and what to do
};
constexpr size_t daemon_state_count = 5;

const char* state_name(DaemonState state);

// A call of the API (docs/operating.md has this table, and a test holds them together).
struct Method {
    const char* name;
    const char* command;  // of the command line, which calls it
    const char* purpose;
    std::vector<DaemonState> allowed;

    bool is_allowed(DaemonState state) const;
};

std::span<const Method> methods();
const Method* find_method(const std::string& name);  // null: there is none

// "idle or armed".
std::string state_words(const std::vector<DaemonState>& states);

}  // namespace ols
