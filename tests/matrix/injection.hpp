// SPDX-License-Identifier: MIT
// Which triggers of a take are struck by which fault: drawn from the scenario's seed, in every kind of slot alike. This is the truth
// that the account of the take is held against.
#pragma once

#include <map>
#include <optional>
#include <random>

#include "scenario.hpp"
#include "stage/sequence.hpp"

namespace ols::test {

struct Strike {
    FaultKind kind = FaultKind::lose_frame;
    int64_t amount = 0;  // frames by which it comes late; nanoseconds by which a clock jumps
};

// When frames are not let go of.
struct Stall {
    bool disk = false;
    int frames = 0;  // that find no room
};

struct Injection {
    std::map<uint64_t, Strike> strikes;   // by trigger
    std::map<uint64_t, Stall> stalls;     // by the trigger at which they begin
    uint64_t board_ends_at = UINT64_MAX;  // the last trigger that it fires
};

// Of take number `take` of the scenario.
Injection draw_injection(const Scenario& scenario, const Sequence& sequence, int take);

}  // namespace ols::test
