// SPDX-License-Identifier: MIT
// The optical code: what frames look like tells where in the cycle they are. The landmarks are tracking and matte slots,
// which look like the last of their kind, and dark slots, which look like black. A basis slot may look like anything;
// a kind of landmark that some basis slot looks like (a lamp behind the subject is dark, half of the lamps for twice the
// time are as bright as tracking) proves nothing any more, and still refutes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "record/frame_summary.hpp"
#include "stage/sequence.hpp"

namespace ols {

enum class Sight {
    disagrees,
    silent,  // nothing is known of how this slot looks
    agrees,  // as its kind does, but basis slots have looked so too
    proves,  // as only its kind does
};

class OpticalCode {
  public:
    // The kinds of one cycle's slots, in order.
    explicit OpticalCode(std::vector<SlotKind> cycle) : cycle_(std::move(cycle)) {}

    size_t cycle_slots() const { return cycle_.size(); }
    SlotKind kind_at(uint64_t counter) const { return cycle_[counter % cycle_.size()]; }

    // Whether a frame can be of the slot that trigger `counter` plays. Silent where nothing is known: a basis slot, or
    // the first lit frame of its kind.
    Sight look(uint64_t counter, const FrameSummary& summary) const;

    // Takes a frame of a proved slot: a landmark is what its kind looks like from now on, a basis slot shows which kinds
    // it can be taken for.
    void learn(uint64_t counter, const FrameSummary& summary);

    struct Seen {
        uint64_t position;  // triggers after the first frame of the run
        const FrameSummary* summary;
    };

    // Which counters of position 0 in [first, last] no frame disagrees with.
    struct Search {
        int possible = 0;      // 0, 1, or 2 for more than one
        uint64_t counter = 0;  // the first of them
        bool proved = false;   // a dark, a matte and a tracking slot look as they should at it
    };
    Search search(std::span<const Seen> frames, uint64_t first, uint64_t last) const;

  private:
    // Proves when all three kinds of landmark look as they should, disagrees when one frame does not.
    Sight look_at_all(std::span<const Seen> frames, uint64_t counter_of_first) const;

    // Whether a frame looks like a landmark's kind; nothing before the first of its kind.
    std::optional<bool> looks_like(SlotKind kind, const FrameSummary& summary) const;

    std::vector<SlotKind> cycle_;
    std::optional<FrameSummary> tracking_, matte_;
    std::array<bool, 4> mistakable_{};  // by SlotKind: some basis slot has looked like it
};

// Frames of one kind a group apart (8 ms in the paper) differ by noise and motion; a quarter leaves room for the first
// lock on a moving subject and is far below what tells tracking from a matte or a single lamp.
constexpr double same_kind_difference = 0.25;

}  // namespace ols
