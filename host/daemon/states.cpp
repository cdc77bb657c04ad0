// SPDX-License-Identifier: MIT
// The table of states and methods.
#include "daemon/states.hpp"

#include <algorithm>

namespace ols {

namespace {

using enum DaemonState;

const std::vector<DaemonState> any = {idle, armed, recording, processing, fault};

// Stop is allowed always: it is what one reaches for when something is wrong.
const std::vector<Method> table = {
    {"version", "stagectl status", "program, API and what it can do", any},
    {"status", "stagectl status", "the present state, whole", any},
    {"subscribe", "stagectl status --watch", "the present state, then every event as it comes", any},
    {"log", "stagectl log", "past events", any},
    {"metrics", "stagectl status --metrics", "figures in Prometheus' text format", any},
    {"takes", "stagectl takes", "the takes on the disk", any},
    {"preview", "stagectl preview", "the latest target, relit, as PNG", any},
    {"arm", "stagectl arm", "program into the board, cameras set up, room on the disk: ready for light", {idle, armed}},
    {"record", "stagectl record", "records a take; arms first where it is not", {idle, armed}},
    {"stop", "stagectl stop", "light off at once; answers when the board has confirmed that it is dark", any},
    {"swap",
     "stagectl swap",
     "another sequence for the takes to come; arms it where the stage is armed",
     {idle, armed}},
    {"calibrate", "stagectl calibrate", "black level and flat field from a white card", {idle}},
    {"clear_fault",
     "stagectl status --clear-fault",
     "ends a fault whose cause is gone, the board's too",
     {idle, fault}},
    {"reload", "stagectl reload", "reads the configuration anew", {idle, fault}},
};

}  // namespace

const char* state_name(DaemonState state) {
    switch (state) {
        case idle: return "idle";
        case armed: return "armed";
        case recording: return "recording";
        case processing: return "processing";
        case fault: return "fault";
    }
    return "";
}

bool Method::is_allowed(DaemonState state) const {
    return std::ranges::find(allowed, state) != allowed.end();
}

std::span<const Method> methods() {
    return table;
}

const Method* find_method(const std::string& name) {
    const auto found = std::ranges::find_if(table, [&](const Method& method) { return method.name == name; });
    return found == table.end() ? nullptr : &*found;
}

std::string state_words(const std::vector<DaemonState>& states) {
    std::string words;
    for (size_t i = 0; i < states.size(); ++i)
        words += (i == 0 ? "" : i + 1 == states.size() ? " or " : ", ") + std::string(state_name(states[i]));
    return words;
}

}  // namespace ols
