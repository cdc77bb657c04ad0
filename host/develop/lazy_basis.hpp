// SPDX-License-Identifier: MIT
// Lazy basis: which instants of a take become targets, and which frames serve each of them (Wenger section 6.1).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "result.hpp"
#include "stage/sequence.hpp"

namespace ols {

// Below, frames are numbered by the triggers of a take: cycle * slots of a cycle + slot.

// The tracking frames of a second, on average over the cycle.
double tracking_rate_hz(const Sequence& sequence);

// At every how manieth tracking frame a target stands for `fps` targets a second: with the paper's 120 tracking frames a
// second, 2, 4 and 5 for 60, 30 and 24. Errors: the tracking rate is no multiple of fps (to a thousandth); names the rates
// there are, and the cameras' frame rates with which there would be fps. No tracking slots.
Result<int> tracking_frames_a_target(const Sequence& sequence, double fps);

// Targets a second, exactly, which what was asked for may differ from by a thousandth: 24 from 23.976.
double target_rate_hz(const Sequence& sequence, int every);

// Of the `every` tracking frames from a target to the next, those that split the time between as evenly as whole frames allow, into
// as many parts as can last `apart_s` on average: counted from the target's own, which is 0 and the first of them. With 0 all.
std::vector<int> evenly_apart(const Sequence& sequence, int every, double apart_s);

// How many tracking frames the take has before this one.
uint64_t tracking_frames_before(const Sequence& sequence, uint64_t number);

// The tracking frames that become targets: from the first one on around which a whole basis was recorded.
std::vector<uint64_t> target_numbers(const Sequence& sequence, int every);

// The frames that a target's samples come from. Of each basis slot the frame nearest in time, half a cycle away at most, the
// earlier of two: for the paper's cycle of 1/12 s from 1/24 s before the target to 1/24 s after. Across the target, a cycle away
// at most, lies the same slot's frame of another cycle: it stands in where the nearer one was lost, and may be blended with it
// (slot_interpolation.hpp).
struct LazyBasis {
    struct Choice {
        uint64_t number = 0;
        int slot = 0;              // of the cycle
        bool is_stand_in = false;  // for a lost one
        // The number of the slot's frame on the target's other side, if recorded; none of a stand-in.
        std::optional<uint64_t> across = {};
    };
    uint64_t target = 0;
    std::vector<Choice> choices;  // in slot order
    std::vector<int> lost;        // slots of the basis that neither cycle has a frame of
};

LazyBasis gather_basis(const Sequence& sequence, uint64_t target, const std::function<bool(uint64_t)>& is_recorded);

// The frames that gather_basis() may ask for, and the tracking frames around them, both ends included.
struct FrameRange {
    uint64_t first = 0, last = 0;
};
FrameRange frames_around(const Sequence& sequence, uint64_t target);

}  // namespace ols
