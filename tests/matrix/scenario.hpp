// SPDX-License-Identifier: MIT
// Scenario: what a take of the fault matrix plays and what goes wrong in it, as a file of tests/matrix/scenarios says.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols::test {

// What is done to single triggers, between the board's pulse and the host.
enum class FaultKind {
    miss_trigger,  // the camera does not see the pulse
    lose_frame,    // the camera counts it, and nothing of the frame arrives
    cut_frame,     // the same, and a part of the frame arrives
    wrong_size,    // it comes two rows short
    stale_buffer,  // it comes with the samples of the frame before
    bad_time,      // its time lies between triggers
    late_within,   // it comes behind up to 10 later ones
    late_beyond,   // it comes 40 frames late
    twice,         // it comes twice
    swap_next,     // the next one comes before it
    no_light,      // the lamps are dark
    restart,       // the camera's count begins anew
    clock_jump,    // the camera's clock jumps, and goes on from there
};

struct FaultSpec {
    FaultKind kind = FaultKind::lose_frame;
    int count = 0;        // of triggers, bursts included
    int burst_max = 1;    // triggers in a row
    double bursts = 0;    // the share of strikes that are bursts
    bool apart = false;   // never beside another
    int64_t jump_ns = 0;  // of clock_jump
};

// Times at which what is identified is not let go of, until frames find no room.
struct StallSpec {
    bool disk = false;             // what holds it up waits for the disk
    int episodes = 0, frames = 0;  // that find no room, in each
};

// How the board ends early.
enum class BoardFault { none, timeline_starved, shifter_starved, late_trigger, emergency_stop, over_duty, reset };

struct Scenario {
    std::string name, basis = "single";
    std::vector<std::string> links;
    int cycles = 10, takes = 1, width = 16, height = 12;
    uint64_t seed = 1;
    std::vector<FaultSpec> faults;
    std::vector<StallSpec> stalls;
    BoardFault board = BoardFault::none;
};

Result<Scenario> read_scenario(const std::string& path);

const char* fault_kind_name(FaultKind kind);

}  // namespace ols::test
