// SPDX-License-Identifier: MIT
// Gathering frames into jobs, and developing those behind the recorder.
#include "take/camera_developer.hpp"

#include <algorithm>
#include <chrono>

#include "exceptions.hpp"
#include "take/provenance.hpp"

namespace ols {

namespace {

bool has_no_frame(const CycleFrames& frames) {
    return std::ranges::none_of(frames.slots, [](const auto& frame) { return frame != nullptr; }) &&
           std::ranges::all_of(frames.neighbours, [](const auto& of_slot) { return of_slot.empty(); });
}
bool has_no_frame(const TargetFrames& frames) {
    return frames.frames.empty() && frames.tracking.empty() && frames.matte.empty();
}

void add_there(std::vector<std::shared_ptr<const Frame>*>& all, std::shared_ptr<const Frame>& frame) {
    if (frame) all.push_back(&frame);
}
std::vector<std::shared_ptr<const Frame>*> frames_of(CycleFrames& frames) {
    std::vector<std::shared_ptr<const Frame>*> all;
    for (auto& frame : frames.slots) add_there(all, frame);
    for (auto& of_slot : frames.neighbours)
        for (auto& frame : of_slot) add_there(all, frame);
    return all;
}
std::vector<std::shared_ptr<const Frame>*> frames_of(TargetFrames& frames) {
    std::vector<std::shared_ptr<const Frame>*> all;
    for (auto& frame : frames.frames) add_there(all, frame);
    for (auto& frame : frames.across) add_there(all, frame);
    for (auto& one : frames.tracking) add_there(all, one.frame);
    for (auto& one : frames.matte) add_there(all, one.frame);
    return all;
}

// The pixels with a mask bit; raises `worst` to their share.
int64_t count(MaskBit bit, const Target& target, double& worst) {
    const auto& mask = target.mask;
    const auto pixels = std::count_if(mask.begin(), mask.end(), [bit](uint32_t bits) { return (bits & bit) != 0; });
    worst = std::max(worst, double(pixels) / double(mask.size()));
    return pixels;
}

}  // namespace

CameraDeveloper::CameraDeveloper(const TakeDescription& take, const TakeTargets& targets, uint32_t camera,
                                 TargetWriter& writer, OutputMonitor& monitor, std::shared_ptr<FrameRoom> room)
    : take_(take),
      camera_(camera),
      is_performance_(targets.every > 0),
      writer_(writer),
      monitor_(monitor),
      developer_(take.sequence, take.calibration.cameras[camera], take.stage.cameras[camera].noise,
                 {take.masks.estimate, take.stage.lamps, 0, take.witness_step}),
      motion_developer_(take.sequence, take.calibration.cameras[camera], take.stage.cameras[camera].noise,
                        {take.masks.estimate, take.stage.lamps, 0, take.witness_step}, targets.quality,
                        std::max(targets.every, 1)),
      plan_(plan_targets(take.sequence, take.masks, targets)),
      store_(take.sequence),
      missing_(take.sequence),
      room_(std::move(room)),
      work_(room_ ? SIZE_MAX : 1),
      thread_([this] { develop(); }) {}

void CameraDeveloper::add_frame(std::shared_ptr<const Frame> frame) {
    if (next_ == plan_.size() || number_of(*frame, take_.sequence) < plan_[next_].frames.first) return;
    const SlotKind kind = take_.sequence.slots[frame->slot].kind;
    const bool is_kept = is_performance_ ? kind != SlotKind::dark : kind == SlotKind::basis;
    if (is_kept) store_.add(std::move(frame));
}

CameraDeveloper::Job CameraDeveloper::gather(size_t index) const {
    const auto& [target, frames] = plan_[index];
    Reason lost_by = missing_.cause_within(frames.first, frames.last);
    if (is_performance_) return {uint32_t(index), store_.around(uint32_t(index), target), std::move(lost_by)};
    return {uint32_t(index), store_.cycle(uint32_t(target), take_.masks.fill_from_neighbours), std::move(lost_by)};
}

void CameraDeveloper::hand_on(uint64_t decided) {
    for (; next_ < plan_.size() && plan_[next_].frames.last < decided; ++next_) {
        Job job = gather(next_);
        // What no later target needs is let go of before the camera may have to wait.
        const bool is_last = next_ + 1 == plan_.size();
        store_.forget_before(is_last ? take_.sequence.trigger_count() : plan_[next_ + 1].frames.first);
        if (std::visit([](const auto& frames) { return has_no_frame(frames); }, job.frames)) {
            lose(next_, next_, job.lost_by);
            continue;
        }
        flush_lost();
        monitor_.hand_on(camera_, plan_[next_].frames.last + 1);
        work_.push(std::move(job));
    }
}

// A take that ends early may have lost millions of targets: they are noted in runs.
void CameraDeveloper::lose(size_t first, size_t last, const Reason& lost_by) {
    const std::string why = "no frame of it was recorded: " + (lost_by.empty() ? "the take ended" : lost_by.text);
    if (lost_ && lost_->why != why) flush_lost();
    if (!lost_) lost_ = LostTargets{camera_, uint32_t(first), uint32_t(last), why};
    lost_->last = uint32_t(last);
}

void CameraDeveloper::flush_lost() {
    if (lost_) work_.push(std::move(*lost_));
    lost_.reset();
}

CameraDeveloper::Report CameraDeveloper::finish() {
    if (!thread_.joinable()) return report_;
    if (next_ < plan_.size()) lose(next_, plan_.size() - 1, {});
    flush_lost();
    work_.close();
    thread_.join();
    report_.seconds_motion = motion_developer_.times();
    return report_;
}

void CameraDeveloper::develop() {
    StageBeat& beat = monitor_.developer_beat(camera_);
    for (;;) {
        beat.beat(StageActivity::waits_for_input);
        auto work = work_.pop();
        if (!work) break;
        beat.beat();
        if (auto* lost = std::get_if<LostTargets>(&*work)) {
            writer_.add(std::move(*lost));
            continue;
        }
        const auto start = std::chrono::steady_clock::now();
        const uint64_t until = plan_[std::get<Job>(*work).index].frames.last + 1;
        TargetOutcome outcome = develop(std::get<Job>(*work));
        work.reset();  // its memory takes the camera's next frames
        report_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        monitor_.develop(camera_, until, outcome.target != nullptr);
        beat.beat(StageActivity::waits_for_room);
        writer_.add(std::move(outcome));
    }
    beat.beat(StageActivity::ended);
}

// Puts copies in memory in the place of frames that are on a disk.
Status CameraDeveloper::bring_back(Job& job) {
    const std::vector<std::shared_ptr<const Frame>*> frames =
        std::visit([](auto& of_target) { return frames_of(of_target); }, job.frames);
    std::erase_if(brought_back_, [&](const auto& known) {
        return std::ranges::none_of(frames, [&](const auto* frame) { return *frame == known.first; });
    });
    for (std::shared_ptr<const Frame>* frame : frames) {
        const auto known = brought_back_.find(*frame);
        if (known != brought_back_.end()) {
            *frame = known->second;
            continue;
        }
        auto brought = room_->bring_back(*frame);
        if (!brought.ok()) return brought.error();
        if (*brought == *frame) continue;
        brought_back_.emplace(*frame, *brought);
        *frame = std::move(*brought);
    }
    return Done{};
}

TargetOutcome CameraDeveloper::develop(Job& job) {
    TargetOutcome outcome{camera_, job.index, nullptr, "", {}};
    outcome.detail = std::visit([&](const auto& frames) { return provenance_of(frames, take_); }, job.frames);
    auto target = guarded("cannot develop it", [&]() -> Result<Target> {
        if (room_)
            if (const Status there = bring_back(job); !there.ok()) return there.error();
        return std::visit([&](const auto& frames) { return develop(frames); }, job.frames);
    });
    if (!target.ok()) {
        outcome.why = target.error().message;
        if (!job.lost_by.empty()) outcome.why += "; the first was lost because: " + job.lost_by.text;
        return outcome;
    }
    outcome.target = std::make_unique<Target>(std::move(*target));
    outcome.target->camera = camera_, outcome.target->index = job.index;
    describe(*outcome.target, outcome.detail);
    return outcome;
}

void CameraDeveloper::describe(Target& target, nlohmann::json& detail) {
    if (target.provenance.is_object()) detail.update(target.provenance);
    detail["saturated_pixels"] = count(mask_saturated, target, report_.saturated_share);
    detail["estimated_pixels"] = count(mask_estimated, target, report_.estimated_share);
    detail["unsolved_pixels"] = count(mask_unsolved, target, report_.unsolved_share);
    if (!target.confidence.empty())
        detail["misaligned_pixels"] = count(mask_misaligned, target, report_.misaligned_share);
    if (const auto witnesses = detail.find("witness_account"); witnesses != detail.end())
        note_suspicion(target.index, *witnesses);
    target.provenance = detail;
}

void CameraDeveloper::note_suspicion(uint32_t target, const nlohmann::json& account) {
    SuspicionReport& report = report_.suspicion;
    if (account.contains("taken_as_missing")) report.slots_left_out += int(account["taken_as_missing"].size());
    if (account.contains("suspect") && size_t(report.suspect_targets++) < SuspicionReport::targets_max) {
        nlohmann::json one = {
            {"camera", camera_}, {"target", target}, {"suspect", account["suspect"]}, {"says", account["says"]}};
        if (account.contains("taken_as_missing")) {
            one["taken_as_missing"] = account["taken_as_missing"];
            one["cause"] = cause_name(Cause::swapped);
        }
        report.targets.push_back(std::move(one));
    }
    if (!account.contains("lamps")) return;
    for (nlohmann::json lamp : account["lamps"]) {
        const std::string name = lamp["lamp"];
        const bool known = report.lamps.contains(name);
        lamp["first_target"] = known ? report.lamps[name]["first_target"] : nlohmann::json(target);
        lamp["camera"] = camera_;
        lamp["last_target"] = target;
        report.lamps[name] = std::move(lamp);
    }
}

}  // namespace ols
