// SPDX-License-Identifier: MIT
// Parts of a recording, one FramePlacer each.
#include "record/recording_placer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ols {

namespace {

const Reason off_the_grid = {Cause::not_proved, "its time fits no trigger"};

Sequence without_end(Sequence sequence) {
    sequence.config.cycles = std::numeric_limits<int>::max();
    return sequence;
}

}  // namespace

RecordingPlacer::RecordingPlacer(const Sequence& sequence, bool has_times)
    : sequence_(without_end(sequence)),
      cycle_slots_(sequence.slots.size()),
      period_ns_(1e9 * sequence.slots.front().period_ticks / double(tick_hz)),
      has_times_(has_times) {
    options_.reorder_frames = 0;
    options_.camera_ns_at_start = UINT64_MAX;  // nothing is known of it
    options_.pending_max = 2 * cycle_slots_ + 2 * size_t(sequence.config.group_slots);
}

void RecordingPlacer::add(FrameWitness frame) {
    if (!placer_) return begin(std::move(frame));
    const auto steps = grid_->steps_to(frame.stamp.timestamp_ns);
    if (steps) {
        refuse_stray();
        grid_->advance(*steps, frame.stamp.timestamp_ns);
        position_ += *steps;
        return place(std::move(frame));
    }
    if (stray_) {
        const TriggerGrid other(period_ns_, stray_->stamp.timestamp_ns, cycle_slots_);
        const auto apart = other.steps_to(frame.stamp.timestamp_ns);
        if (apart && *apart == frame.stamp.frame_id - stray_->stamp.frame_id) {
            end_part();
            ++restarts_;
            FrameWitness first = std::move(*stray_);
            stray_.reset();
            begin(std::move(first));
            return add(std::move(frame));
        }
    }
    refuse_stray();
    stray_ = std::move(frame);
}

void RecordingPlacer::end() {
    refuse_stray();
    end_part();
}

void RecordingPlacer::refuse_stray() {
    if (stray_) placements_.push_back({stray_->arrival, {}, false, off_the_grid});
    stray_.reset();
}

void RecordingPlacer::begin(FrameWitness frame) {
    placer_ = std::make_unique<FramePlacer>(sequence_, options_);
    grid_.emplace(period_ns_, frame.stamp.timestamp_ns, cycle_slots_);
    position_ = 0;
    first_trigger_.reset();
    first_ns_ = frame.stamp.timestamp_ns;
    place(std::move(frame));
}

void RecordingPlacer::place(FrameWitness frame) {
    last_ns_ = frame.stamp.timestamp_ns;
    // The part's first frame is of one cycle's slots; which, the optical code says.
    frame.fired_before = cycle_slots_ + position_;
    const FrameWitness copy = frame;
    placer_->add(std::move(frame));
    take_from_placer();
    if (!std::exchange(disagreed_, false) || has_times_) return;
    // Something is missing that no number tells of, and this frame is behind it.
    next_trigger_ = *placements_.back().counter;
    next_ns_ = last_ns_;
    placements_.pop_back();
    placer_.reset();
    ++restarts_;
    begin(copy);
}

void RecordingPlacer::end_part() {
    if (!placer_) return;
    placer_->end();
    take_from_placer();
    placer_.reset();
    if (first_trigger_) next_ns_ = last_ns_ + uint64_t(period_ns_);
}

// The placer counts from a cycle of its own. Of the cycles that this can be, the one nearest to what times and numbers say, and
// behind all that was placed.
uint64_t RecordingPlacer::first_trigger_of(const Placement& placement) const {
    if (next_trigger_ == 0) return 0;
    const double passed = (double(first_ns_) - double(next_ns_)) / period_ns_;
    const double slot = double(*placement.counter % cycle_slots_);
    uint64_t turns =
        uint64_t(std::max(0.0, std::round((double(next_trigger_) + passed - slot) / double(cycle_slots_))));
    while (turns * cycle_slots_ + *placement.counter < next_trigger_) ++turns;
    return turns * cycle_slots_;
}

void RecordingPlacer::take_from_placer() {
    for (Placement& placement : placer_->take_placements()) {
        if (!placement.arrival) continue;
        if (placement.counter) {
            if (!first_trigger_) first_trigger_ = first_trigger_of(placement);
            placement.counter = *placement.counter + *first_trigger_;
            next_trigger_ = std::max(next_trigger_, *placement.counter + 1);
        }
        disagreed_ = !placement.accepted && placement.optical == Sight::disagrees;
        placements_.push_back(std::move(placement));
    }
}

std::vector<Placement> RecordingPlacer::take_placements() {
    return std::exchange(placements_, {});
}

uint64_t RecordingPlacer::lowest_open() const {
    if (!placer_ || !first_trigger_) return next_trigger_;
    return *first_trigger_ + placer_->lowest_open();
}

}  // namespace ols
