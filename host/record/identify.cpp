// SPDX-License-Identifier: MIT
// The trigger log against the placed frames, and the account of every trigger.
#include "record/identify.hpp"

#include <algorithm>
#include <cstdlib>

namespace ols {

Identifier::Identifier(const Sequence& sequence, const IdentifyOptions& options)
    : trigger_count_(sequence.trigger_count()),
      cycle_slots_(sequence.slots.size()),
      period_ticks_(sequence.slots.front().period_ticks),
      placer_(sequence, options) {}

void Identifier::add_frame(FrameWitness frame) {
    placer_.add(std::move(frame));
    settle();
}

void Identifier::add_log(const std::vector<ols_trigger_log_entry>& entries, uint64_t next_counter, uint64_t arrivals) {
    for (const auto& entry : entries) {
        if (!first_entry_) first_entry_ = entry;
        if (entry.counter >= decided_) log_[entry.counter] = entry;
        log_end_ = std::max<uint64_t>(log_end_, uint64_t(entry.counter) + 1);
    }
    placer_.bound(arrivals, next_counter);
    settle();
}

void Identifier::end_log(const Reason& why) {
    log_ended_ = why;
    settle();
}

void Identifier::end_frames(const Reason& why, uint64_t disk_drops, uint64_t host_drops) {
    placer_.end();
    last_drops_ = placer_.drops_left(disk_drops, host_drops);
    frames_ended_ = why;
    settle();
}

std::vector<Verdict> Identifier::take_verdicts() {
    return std::exchange(verdicts_, {});
}

void Identifier::settle() {
    take_placements();
    match_log();
    decide();
}

MissingSlot& Identifier::note(uint64_t counter) {
    MissingSlot& slot = notes_[counter];
    slot.counter = counter;
    return slot;
}

void Identifier::take_placements() {
    for (Placement& placement : placer_.take_placements()) {
        if (placement.accepted) {
            accepted_.push_back({*placement.arrival, *placement.counter});
            frames_until_ = *placement.counter + 1;
            continue;
        }
        if (placement.counter && *placement.counter >= decided_) {
            MissingSlot& slot = note(*placement.counter);
            slot.why = placement.why;
            slot.camera = placement.arrival.has_value();
            slot.optical = placement.optical;
            if (placement.arrival) frames_until_ = std::max(frames_until_, *placement.counter + 1);
        }
        if (placement.arrival)
            verdicts_.push_back({Verdict::discarded, *placement.arrival, {}, {}, std::move(placement.why)});
    }
}

// An entry is a witness only if the board did at that tick what the program says: one program, played from its start.
bool Identifier::fits_program(const ols_trigger_log_entry& entry) const {
    // As much as any board lets pass: 3 for the measurement, and the echo of a trigger cable of 10 m, 100 ns or 13 ticks.
    constexpr int64_t tolerance_ticks = 3 + 13;
    const int64_t expected =
        int64_t(first_entry_->rise_ticks) + (int64_t(entry.counter) - int64_t(first_entry_->counter)) * period_ticks_;
    return entry.slot == entry.counter % cycle_slots_ && entry.cycle == entry.counter / cycle_slots_ &&
           std::abs(int64_t(entry.rise_ticks) - expected) <= tolerance_ticks;
}

// Of a trigger behind the last frame: we know of a loss only when it was ours.
Reason Identifier::take_last_loss() {
    if (last_drops_.empty()) return {Cause::no_frame, "no frame came"};
    Reason why = std::move(last_drops_.back());
    last_drops_.pop_back();
    return why;
}

// A trigger has had its light once the board has fired the next, or has played to the end: a board that is stopped, faults or
// is unplugged goes dark in the middle of a slot.
void Identifier::match_log() {
    for (; !accepted_.empty(); accepted_.pop_front()) {
        const Accepted frame = accepted_.front();
        if (frame.counter + 1 >= log_end_ && !log_ended_) return;
        const auto entry = log_.find(frame.counter);
        const bool was_cut_off = frame.counter + 1 == log_end_ && log_ended_ && !log_ended_->empty();
        if (entry != log_.end() && fits_program(entry->second) && !was_cut_off) {
            identified_[frame.counter] = true;
            verdicts_.push_back({Verdict::identified, frame.arrival, entry->second, {}, {}});
            continue;
        }
        MissingSlot& slot = note(frame.counter);
        slot.camera = true;
        slot.why = was_cut_off ? Reason{log_ended_->cause, "its light may have been cut off: " + log_ended_->text}
                   : entry != log_.end()
                       ? Reason{Cause::log_lost_it, "the trigger log has another slot or time than the program"}
                   : frame.counter < log_end_ ? Reason{Cause::log_lost_it, "the board's trigger log lost it"}
                   : log_ended_->empty()      ? Reason{Cause::board_did_not_fire, "the board did not fire it"}
                                              : *log_ended_;
        verdicts_.push_back({Verdict::discarded, frame.arrival, {}, {}, slot.why});
    }
}

void Identifier::decide() {
    uint64_t open = std::min(placer_.lowest_open(), log_end_);
    if (!accepted_.empty()) open = std::min(open, accepted_.front().counter);
    if (frames_ended_ && log_ended_) open = trigger_count_;
    for (; decided_ < open; ++decided_) {
        if (identified_.erase(decided_) == 0) {
            MissingSlot& slot = note(decided_);
            slot.board = log_.contains(decided_);
            if (slot.why.empty()) {
                const bool fired = slot.board || !log_ended_ || log_ended_->empty();
                const bool camera_went = frames_ended_ && !frames_ended_->empty() && decided_ >= frames_until_;
                slot.why = !fired ? *log_ended_ : camera_went ? *frames_ended_ : take_last_loss();
            }
            verdicts_.push_back({Verdict::missing, 0, {}, slot, {}});
        }
        notes_.erase(decided_);
        log_.erase(decided_);
    }
}

}  // namespace ols
