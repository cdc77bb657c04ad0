// SPDX-License-Identifier: MIT
// RecordingPlacer: the triggers of a recording's frames, from their numbers, times and the optical code alone.
//
// Triggers are counted from slot 0 of the cycle in which the recording began. A FramePlacer places frames as long as they lie on one
// grid and look as they should; then another begins anew with the frame that did not, and its place is sought within a cycle's turn
// after what was placed before.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "record/place.hpp"

namespace ols {

class RecordingPlacer {
  public:
    // `has_times`: frames have times of their own, so that a landmark that looks wrong is no loss that nobody counted.
    RecordingPlacer(const Sequence& sequence, bool has_times);

    // Frames come in their order; `arrival` is the frame's index.
    void add(FrameWitness frame);
    void end();

    // Of frames alone: what no frame has is missing.
    std::vector<Placement> take_placements();

    // Every frame still to be placed has a trigger of at least this.
    uint64_t lowest_open() const;

    uint64_t restarts() const { return restarts_; }

  private:
    void begin(FrameWitness frame);
    void place(FrameWitness frame);
    void end_part();
    void take_from_placer();
    uint64_t first_trigger_of(const Placement& placement) const;
    void refuse_stray();

    const Sequence sequence_;  // of as many cycles as there can be
    const uint64_t cycle_slots_;
    const double period_ns_;
    const bool has_times_;
    IdentifyOptions options_;

    // Since the last begin.
    std::unique_ptr<FramePlacer> placer_;
    std::optional<TriggerGrid> grid_;
    uint64_t position_ = 0;                  // of the last frame on the grid
    std::optional<uint64_t> first_trigger_;  // of the placer's counter 0, once it is known
    uint64_t first_ns_ = 0, last_ns_ = 0;    // of its frames on the grid

    std::optional<FrameWitness> stray_;  // off the grid: a wrong time, or the first of another grid
    uint64_t next_trigger_ = 0;          // above every trigger that a frame was placed at
    uint64_t next_ns_ = 0;               // when that one is due, as far as is known
    bool disagreed_ = false;             // the last frame added did not look as its slot does
    uint64_t restarts_ = 0;
    std::vector<Placement> placements_;
};

}  // namespace ols
