// SPDX-License-Identifier: MIT
// Stretches, runs and landmarks.
#include "record/place.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

std::vector<SlotKind> kinds_of(const Sequence& sequence) {
    std::vector<SlotKind> kinds;
    for (const Slot& slot : sequence.slots) kinds.push_back(slot.kind);
    return kinds;
}

const Reason off_grid = {Cause::not_proved, "its time fits no trigger"};
// Frames in a row that fit each other, and not the frames before, until it is the camera's clock that is taken to be another: two
// stamps that are wrong alike come of one moment in which a machine was late.
constexpr size_t new_clock_frames = 4;
const std::string in_the_dark = "dark, as the last tracking slot before it";

}  // namespace

FramePlacer::FramePlacer(const Sequence& sequence, const IdentifyOptions& options)
    : trigger_count_(sequence.trigger_count()),
      group_slots_(size_t(sequence.config.group_slots)),
      period_ns_(1e9 * sequence.slots.front().period_ticks / double(tick_hz)),
      options_(options),
      window_(options.reorder_frames, period_ns_),
      code_(kinds_of(sequence)) {}

void FramePlacer::add(FrameWitness frame) {
    if (frame.arrival < bound_arrivals_) frame.fired_before = bound_fired_;
    const FrameWitness copy = frame;
    switch (window_.add(std::move(frame))) {
        case ReorderWindow::Arrival::duplicate:
            ++duplicates_;
            refuse(copy, {Cause::not_proved, "duplicate: the camera delivered this id and time before"});
            break;
        case ReorderWindow::Arrival::too_late:
            refuse(copy, {Cause::link_lost_it, "late: delivered after its reorder window"});
            break;
        case ReorderWindow::Arrival::in_time: break;
    }
    while (auto next = window_.take(false)) process(std::move(*next));
}

void FramePlacer::bound(uint64_t arrivals, uint64_t fired) {
    const auto tell = [&](FrameWitness& frame) {
        if (frame.arrival < arrivals) frame.fired_before = std::min(frame.fired_before, fired);
    };
    window_.for_each(tell);
    for (FrameWitness& stray : strays_) tell(stray);
    for (Pending& pending : unlocked_) tell(pending.frame);
    bound_arrivals_ = arrivals;
    bound_fired_ = fired;
}

void FramePlacer::end() {
    while (auto next = window_.take(true)) process(std::move(*next));
    refuse_strays();
    end_stretch();
}

void FramePlacer::refuse_strays() {
    for (const FrameWitness& stray : strays_) {
        refuse(stray, stray.unfit.empty() ? off_grid : stray.unfit);
        if (stray.epoch == last_epoch_) stray_ids_.push_back(stray.stamp.frame_id);
    }
    strays_.clear();
}

// On one grid, with ids that step as times do.
bool FramePlacer::fit_each_other(const std::vector<FrameWitness>& frames) const {
    for (size_t n = 1; n < frames.size(); ++n) {
        const TriggerGrid grid(period_ns_, frames[n - 1].stamp.timestamp_ns, code_.cycle_slots());
        const auto steps = grid.steps_to(frames[n].stamp.timestamp_ns);
        if (!steps || *steps != frames[n].stamp.frame_id - frames[n - 1].stamp.frame_id ||
            frames[n].epoch != frames[n - 1].epoch)
            return false;
    }
    return true;
}

void FramePlacer::process(FrameWitness frame) {
    has_seen_light_ = has_seen_light_ || !frame.unfit.empty() || !is_dark(frame.summary);
    if (!grid_) return begin_stretch(std::move(frame), {Cause::no_frame, "before the camera's first frame"});
    if (const auto steps = steps_on_grid(frame)) {
        refuse_strays();
        append(frame, *steps);
        stray_ids_.clear();
        return;
    }
    // Frames in a row that fit each other but not the grid: the camera's clock was set anew.
    FrameWitness newest = frame;
    strays_.push_back(std::move(frame));
    if (!fit_each_other(strays_)) {
        strays_.pop_back();
        refuse_strays();
        strays_.push_back(std::move(newest));
    }
    if (strays_.size() < new_clock_frames) return;
    end_stretch();
    stray_ids_.clear();
    ++camera_restarts_;
    std::vector<FrameWitness> frames = std::exchange(strays_, {});
    begin_stretch(std::move(frames.front()),
                  {Cause::restarted, "the camera's clock was set anew, and no frame is proved to be this one"});
    for (size_t n = 1; n < frames.size(); ++n)
        if (const auto steps = steps_on_grid(frames[n]))
            append(frames[n], *steps);
        else
            refuse(frames[n], off_grid);
}

void FramePlacer::begin_stretch(FrameWitness frame, Reason gap) {
    grid_.emplace(period_ns_, frame.stamp.timestamp_ns, code_.cycle_slots());
    last_stamp_ = frame.stamp;
    last_epoch_ = frame.epoch;
    last_position_ = 0;
    locked_ = false;
    next_attempt_ = code_.cycle_slots();
    place({std::move(frame), 0, true, {std::move(gap)}});
}

// How many triggers a frame lies behind the last one, if its time lies on the grid, the sequence has a trigger there, and the board had
// fired it when the frame was here.
std::optional<uint64_t> FramePlacer::steps_on_grid(const FrameWitness& frame) const {
    const auto steps = grid_->steps_to(frame.stamp.timestamp_ns);
    if (!steps || (frame.epoch == last_epoch_ && !can_have_passed(*steps, frame.stamp.frame_id))) return std::nullopt;
    const uint64_t counter = lowest_first_counter() + last_position_ + *steps;
    if (counter >= trigger_count_ || (locked_ && counter >= frame.fired_before)) return std::nullopt;
    return steps;
}

// Whether so many triggers can have passed by the camera's time while it counted up to that id. More ids than triggers there are not; and
// where triggers that it did not count make whole groups, it is as well the clock that jumped by these: the next landmarks look the same.
bool FramePlacer::can_have_passed(uint64_t steps, uint64_t frame_id) const {
    const uint64_t id_steps = frame_id - last_stamp_.frame_id;
    if (id_steps > steps) return id_steps - steps <= strays_.size();
    return id_steps == steps || (steps - id_steps) % group_slots_ != 0;
}

// Adds a frame that lies so far behind the last one to the stretch.
void FramePlacer::append(FrameWitness& frame, uint64_t steps) {
    grid_->advance(steps, frame.stamp.timestamp_ns);
    const bool restarted = frame.epoch != last_epoch_;
    const uint64_t id_steps = frame.stamp.frame_id - last_stamp_.frame_id;
    camera_restarts_ += restarted;
    std::vector<Reason> gap = restarted ? std::vector<Reason>{{Cause::restarted, "the camera was restarted"}}
                                        : losses(frame, steps, id_steps);
    last_stamp_ = frame.stamp;
    last_epoch_ = frame.epoch;
    last_position_ += steps;
    place({std::move(frame), last_position_, restarted || id_steps != steps, std::move(gap)});
}

// Why the triggers between the frame before and this one have none: of as many as ids were passed over, the frames were lost on
// their way, and of these as many by us as were dropped meanwhile; the camera saw nothing of the others. Which of them is which
// is not known: the numbers are right, and their order here is not.
std::vector<Reason> FramePlacer::losses(const FrameWitness& frame, uint64_t steps, uint64_t id_steps) {
    const uint64_t gap = steps - 1;
    const uint64_t without = id_steps == 0 ? 0 : std::min(gap, id_steps - 1);
    const uint64_t lost = without - std::min<uint64_t>(without, stray_ids_.size());
    std::vector<Reason> reasons = take_drops(lost, frame.disk_drops, frame.host_drops);
    reasons.resize(lost, {Cause::link_lost_it, "lost: the camera counted the frame and it did not come"});
    name_strays(reasons, without);
    reasons.insert(reasons.end(), gap - without,
                   {Cause::camera_missed_trigger, "the camera did not count the trigger"});
    if (reasons.empty()) reasons.push_back({Cause::no_frame, "no frame came"});
    return reasons;
}

// Frames of a gap that came, and were refused for their times: where they are among its ids is known.
void FramePlacer::name_strays(std::vector<Reason>& reasons, uint64_t without) const {
    for (const uint64_t id : stray_ids_) {
        if (reasons.size() >= without) return;
        const auto at = ptrdiff_t(std::min<uint64_t>(id - last_stamp_.frame_id - 1, reasons.size()));
        reasons.insert(reasons.begin() + at, off_grid);
    }
}

// Of the drops that were told of, those that no gap was found for yet, `count` at most.
std::vector<Reason> FramePlacer::take_drops(uint64_t count, uint64_t disk_drops, uint64_t host_drops) {
    const uint64_t by_disk = std::min(count, disk_drops - std::min(disk_drops, disk_drops_));
    const uint64_t by_host = std::min(count - by_disk, host_drops - std::min(host_drops, host_drops_));
    disk_drops_ += by_disk;
    host_drops_ += by_host;
    std::vector<Reason> reasons(
        by_disk, {Cause::disk_was_late, "dropped: it came, and room was held by what waited for a disk"});
    reasons.resize(by_disk + by_host, {Cause::host_was_late, "dropped: it came, and there was no room for it"});
    return reasons;
}

void FramePlacer::place(Pending pending) {
    if (locked_) return examine(std::move(pending));
    unlocked_.push_back(std::move(pending));
    if (unlocked_.size() > options_.pending_max)
        give_up_oldest(1, {Cause::not_proved, "its place in the cycle was not proved before memory ran out"});
    if (last_position_ + 1 < next_attempt_) return;
    next_attempt_ = last_position_ + 1 + group_slots_;
    try_lock();
}

// The triggers that can have fired by a camera time, one after the other from the start of the board on; clocks may differ by a
// thousandth.
uint64_t FramePlacer::triggers_until(uint64_t timestamp_ns) const {
    constexpr double fastest_clock = 1.001;
    if (!is_first_stretch_ || timestamp_ns <= options_.camera_ns_at_start) return trigger_count_;
    return uint64_t(fastest_clock * double(timestamp_ns - options_.camera_ns_at_start) / period_ns_) + 2;
}

void FramePlacer::try_lock() {
    std::vector<OpticalCode::Seen> seen;
    uint64_t end = trigger_count_ - last_position_;  // above the last possible counter of position 0
    for (const Pending& pending : unlocked_) {
        if (pending.frame.unfit.empty()) seen.push_back({pending.position, &pending.frame.summary});
        if (pending.frame.fired_before < UINT64_MAX)
            end = std::min(end, pending.frame.fired_before - std::min(pending.frame.fired_before, pending.position));
        const uint64_t limit = triggers_until(pending.frame.stamp.timestamp_ns);
        end = std::min(end, limit - std::min(limit, pending.position));
    }
    if (end <= next_counter_) return;
    const OpticalCode::Search found = code_.search(seen, next_counter_, end - 1);
    if (found.possible == 0) return give_up_oldest(group_slots_, nothing_fits());
    if (found.possible > 1 || !found.proved) return;
    locked_ = true;
    first_counter_ = found.counter;
    // Landmarks from last to first, so that the first of each kind is what the next one is compared with; then what basis
    // slots can be taken for.
    const auto learn = [&](bool basis, const Pending& pending) {
        const uint64_t counter = counter_of(pending);
        if (pending.frame.unfit.empty() && (code_.kind_at(counter) == SlotKind::basis) == basis)
            code_.learn(counter, pending.frame.summary);
    };
    for (auto pending = unlocked_.rbegin(); pending != unlocked_.rend(); ++pending) learn(false, *pending);
    for (const Pending& pending : unlocked_) learn(true, pending);
    for (Pending& pending : std::exchange(unlocked_, {})) examine(std::move(pending));
}

// Of the frames of a stretch that has no place.
Reason FramePlacer::nothing_fits() const {
    if (has_seen_light_) return {Cause::not_proved, "no place in the cycle fits it"};
    return {Cause::no_light, "no frame shows any light: check the lamps' supply, the lens and its cap"};
}

void FramePlacer::give_up_oldest(size_t count, const Reason& why) {
    for (; count > 0 && !unlocked_.empty(); --count) {
        refuse(unlocked_.front().frame, why);
        unlocked_.pop_front();
        if (!unlocked_.empty()) unlocked_.front().gap = {why};
    }
}

void FramePlacer::examine(Pending pending) {
    const uint64_t counter = counter_of(pending);
    if (pending.begins_run) end_run();
    for (size_t n = 0; next_counter_ < counter; ++next_counter_, ++n)
        placements_.push_back({{}, next_counter_, false, pending.gap[std::min(n, pending.gap.size() - 1)]});
    next_counter_ = counter + 1;
    const FrameWitness& frame = pending.frame;
    const Sight sight = frame.unfit.empty() ? code_.look(counter, frame.summary) : Sight::silent;
    pending.optical = sight;
    if (sight >= Sight::agrees) code_.learn(counter, frame.summary);
    waiting_.push_back(std::move(pending));
    if (waiting_.size() > options_.pending_max)
        refuse_waiting({Cause::not_proved, "no landmark proved it before memory ran out"});
    if (sight == Sight::proves) {
        accept_waiting();
    } else if (sight == Sight::disagrees) {
        // A lit landmark that is dark: a dark slot that looks lit is the other way round.
        const bool no_light = code_.kind_at(counter) != SlotKind::dark && is_dark(frame.summary);
        refuse_waiting(
            {no_light ? Cause::no_light : Cause::not_proved,
             fmt::format("the optical code disagrees: trigger {} {} a {} slot", counter,
                         no_light ? "is dark, and is" : "does not look like", slot_kind_name(code_.kind_at(counter)))});
        proved_ = false;
        in_the_dark_ |= no_light;
    }
}

void FramePlacer::end_run() {
    if (proved_)
        accept_waiting();
    else if (in_the_dark_)
        refuse_waiting({Cause::no_light, in_the_dark});
    else
        refuse_waiting({Cause::not_proved, "neither the landmark before it nor one after it proves it"});
    proved_ = false;
}

void FramePlacer::end_stretch() {
    if (!locked_ && !unlocked_.empty()) try_lock();
    if (locked_) end_run();
    Reason why = nothing_fits();
    if (why.cause != Cause::no_light) why.text = "its place in the cycle could not be proved";
    for (const Pending& pending : unlocked_) refuse(pending.frame, why);
    unlocked_.clear();
    grid_.reset();
    is_first_stretch_ = false;
    locked_ = false;
}

// Where there was no light, no frame is believed to have had any before one does: in the dark every slot looks dark.
void FramePlacer::accept_waiting() {
    for (const Pending& pending : waiting_) {
        const FrameWitness& frame = pending.frame;
        const uint64_t counter = counter_of(pending);
        in_the_dark_ &= !frame.unfit.empty() || is_dark(frame.summary);
        if (in_the_dark_) {
            placements_.push_back({frame.arrival, counter, false,
                                   frame.unfit.empty() ? Reason{Cause::no_light, in_the_dark} : frame.unfit,
                                   pending.optical});
            continue;
        }
        if (frame.unfit.empty() && code_.kind_at(counter) == SlotKind::basis) code_.learn(counter, frame.summary);
        placements_.push_back({frame.arrival, counter, frame.unfit.empty(), frame.unfit, pending.optical});
    }
    proved_ = !in_the_dark_;
    waiting_.clear();
}

// Where it is light that was missing, frames that have some are only not proved. What is wrong with a frame itself stays the reason.
void FramePlacer::refuse_waiting(const Reason& why) {
    for (const Pending& pending : waiting_) {
        const FrameWitness& frame = pending.frame;
        const bool is_lit = why.cause == Cause::no_light && !is_dark(frame.summary);
        const Reason own = is_lit ? Reason{Cause::not_proved, why.text} : why;
        placements_.push_back(
            {frame.arrival, counter_of(pending), false, frame.unfit.empty() ? own : frame.unfit, pending.optical});
    }
    waiting_.clear();
}

void FramePlacer::refuse(const FrameWitness& frame, const Reason& why) {
    placements_.push_back({frame.arrival, {}, false, why});
}

std::vector<Placement> FramePlacer::take_placements() {
    return std::exchange(placements_, {});
}

std::vector<Reason> FramePlacer::drops_left(uint64_t disk_drops, uint64_t host_drops) {
    return take_drops(trigger_count_, disk_drops, host_drops);
}

uint64_t FramePlacer::lowest_open() const {
    return waiting_.empty() ? next_counter_ : counter_of(waiting_.front());
}

std::optional<uint64_t> FramePlacer::latest_time_of_ns(uint64_t counter) const {
    if (!grid_) return std::nullopt;
    return grid_->time_after_ns(int64_t(counter) - int64_t(lowest_first_counter() + last_position_));
}

std::optional<double> FramePlacer::drift_ppm() const {
    if (!locked_) return std::nullopt;
    return grid_->drift_ppm();
}

}  // namespace ols
