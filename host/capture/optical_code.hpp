// SPDX-License-Identifier: MIT
// The optical code: what frames look like tells where in the cycle they are. Tracking and matte slots look like the
// last of their kind, dark slots like black; a basis slot may look like anything.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "capture/frame_summary.hpp"
#include "stage/sequence.hpp"

namespace ols {

enum class Sight { silent, agrees, disagrees };

class OpticalCode {
  public:
    // The kinds of one cycle's slots, in order.
    explicit OpticalCode(std::vector<SlotKind> cycle) : cycle_(std::move(cycle)) {}

    size_t cycle_slots() const { return cycle_.size(); }
    SlotKind kind_at(uint64_t counter) const { return cycle_[counter % cycle_.size()]; }

    // Whether a frame can be of the slot that trigger `counter` plays. Silent where nothing is known: a basis slot, or
    // the first lit frame of its kind.
    Sight look(uint64_t counter, const FrameSummary& summary) const;

    // Takes a frame of a proved slot as what its kind looks like from now on.
    void learn(uint64_t counter, const FrameSummary& summary);

    struct Seen {
        uint64_t position;  // triggers after the first frame of the run
        const FrameSummary* summary;
    };

    // The counter of position 0 in [first, last] that no frame disagrees with, if there is exactly one and a dark, a
    // matte and a tracking slot agree with it.
    std::optional<uint64_t> find_unique(std::span<const Seen> frames, uint64_t first, uint64_t last) const;

  private:
    // Agrees when the three kinds of landmark do, disagrees when one frame does.
    Sight look_at_all(std::span<const Seen> frames, uint64_t counter_of_first) const;

    std::vector<SlotKind> cycle_;
    std::optional<FrameSummary> tracking_, matte_;
};

// Frames of one kind a group apart (8 ms in the paper) differ by noise and motion; a quarter leaves room for the first
// lock on a moving subject and is far below what tells tracking from a matte or a single lamp.
constexpr double same_kind_difference = 0.25;

}  // namespace ols
