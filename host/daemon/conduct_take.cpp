// SPDX-License-Identifier: MIT
// The conductor's takes: from armed by way of light and dark to an archive that is finished.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "daemon/conductor.hpp"
#include "image/bytes_text.hpp"
#include "take/stage_watch.hpp"
#include "take/take_json.hpp"

namespace ols {

namespace {

// A reply that is given once, by whatever comes first.
template <typename Reply, typename Value>
void reply_once(const Reply& reply, Value&& value) {
    try {
        reply->set_value(std::forward<Value>(value));
    } catch (const std::future_error&) {  // it was replied to when light came
    }
}

// Why disks and devices can be no longer trusted after a take; empty when they can.
std::string trouble_of(const TakeReport& report, const StopRequest& stop) {
    std::string trouble;
    const auto add = [&](const std::string& text) { trouble += (trouble.empty() ? "" : "; ") + text; };
    for (const OutputReport& output : report.outputs)
        if (!output.write_error.empty()) add("the archive could not be written whole: " + output.write_error);
    if (!report.memory.problem.empty()) add(report.memory.problem);
    const size_t of_disks = trouble.size();
    const RecordReport& record = report.record;
    const Cause end = record.board_end.cause;
    if (end == Cause::board_gone || end == Cause::board_did_not_fire) add(record.board_end.text);
    for (const CameraReport& camera : record.cameras)
        if (!camera.end.empty()) add(fmt::format("camera {}: {}", camera.index, camera.end.text));
    if (trouble.size() == of_disks && end == Cause::stopped && !stop.wanted) add(record.board_end.text);
    return trouble;
}

}  // namespace

void Conductor::say_notes(const std::vector<std::string>& notes) {
    for (const std::string& note : notes) events_.add(EventKind::note, note);
}

Status Conductor::arm_now(const TakeRequest& request) {
    auto plan = plan_take(request, snapshot().sequence, stage_);
    if (!plan) return plan.error();  // what is armed stays as it is
    plan_.reset();
    const DiskForecast& disk = plan->forecast;
    if (!disk.fits()) {
        const std::string why = fmt::format(
            "the disk of '{}' has {} free, of which {} are kept: {:.1f} s of this take fit, and not {:.1f} s, which "
            "take up "
            "to {}; make room, or record a shorter take",
            stage_.daemon.takes, bytes_text(double(disk.bytes_free)), bytes_text(double(disk.bytes_reserve)),
            disk.seconds_that_fit, disk.seconds, bytes_text(double(disk.bytes_needed)));
        if (devices_) (void)devices_->make_dark();
        events_.add(EventKind::disk_short, why, plan->to_json());
        change_state(DaemonState::idle);
        return fail(why);
    }
    const auto armed = [&]() -> Status {
        if (const Status there = hold_devices(); !there) return there;
        if (const Status dark = devices_->make_dark(); !dark) return dark;
        const auto cameras = devices_->cameras();
        for (size_t i = 0; i < cameras.size(); ++i)
            if (const Status set = cameras[i]->set_up(stage_.cameras[i]); !set.ok()) return set;
        return arm_board(devices_->board(), plan->sequence, stage_);
    }();
    if (!armed) {
        change_state(DaemonState::idle);
        next_look_ = {};  // what is wrong with a device shows at the next look
        return armed;
    }
    say_notes(notes_on_targets(plan->choices, plan->sequence, plan->targets));
    plan_ = std::move(*plan);
    {
        const std::lock_guard lock(mutex_);
        now_.plan = plan_->to_json();
    }
    events_.add(EventKind::armed,
                fmt::format("armed with {}: {} cycles of {} slots, {:.1f} s, up to {} of {} free", plan_->sequence_name,
                            plan_->sequence.config.cycles, plan_->sequence.slots.size(), disk.seconds,
                            bytes_text(double(disk.bytes_needed)), bytes_text(double(disk.bytes_free))),
                plan_->to_json());
    change_state(DaemonState::armed);
    return Done{};
}

Status Conductor::wait_for_button(StageWatch& watch) {
    if (!watch.has_arm_button()) return Done{};
    {
        const std::lock_guard lock(mutex_);
        now_.waits_for = "the arm button";
    }
    events_.add(EventKind::waits_for_button, "the arm button begins the take");
    const auto look = [this, next = Clock::now()]() mutable -> Status {
        if (Clock::now() < next) return Done{};
        next = Clock::now() + look_pause;
        return devices_->look(true);
    };
    const Status pressed = watch.wait_for_arm(look);
    const std::lock_guard lock(mutex_);
    now_.waits_for.clear();
    return pressed;
}

void Conductor::begin_take(std::shared_ptr<RunningTake> take) {
    {
        const std::lock_guard lock(mutex_);
        take->began = Clock::now();
        now_.take = std::move(take);
    }
    change_state(DaemonState::recording, now_.take->name);
}

void Conductor::record_now(const TakeRequest& request, const Reply& reply) {
    std::string name_text;
    const auto refuse = [&](const Error& why) {
        events_.add(EventKind::take_failed, why.message, {{"take", name_text}});
        reply_once(reply, Outcome(why));
    };
    TakeRequest wanted = plan_ ? request.completed_by(plan_->request) : request;
    if (wanted.slate.empty()) wanted.slate = stage_.daemon.slate;
    const auto name = TakeFolder(stage_.daemon.takes).next(wanted.slate, wanted.number);
    if (!name) return reply_once(reply, Outcome(name.error()));
    name_text = name->text();
    if (!plan_ || !plan_->request.is_armed_like(wanted))
        if (const Status armed = arm_now(wanted); !armed) return reply_once(reply, Outcome(armed.error()));
    TakePlan plan = std::move(*plan_);
    plan_.reset();
    plan.choices.slate.scene = wanted.slate, plan.choices.slate.notes = wanted.notes;
    plan.choices.slate.take = fmt::format("{}", name->number);
    plan.choices.output = TakeFolder(stage_.daemon.takes).archive_of(*name);
    for (const std::string& quality : wanted.also)
        plan.choices.also.push_back(quality + "=" + TakeFolder(stage_.daemon.takes).archive_of(*name, quality));
    const auto back_to_idle = [&](const Error& why) {
        if (devices_) (void)devices_->make_dark();
        refuse(why);
        change_state(DaemonState::idle);
    };
    auto archives = plan_archives(plan.choices, plan.sequence, stage_, plan.targets);
    if (!archives) return back_to_idle(archives.error());
    auto watch = StageWatch::open(stage_, stop_);
    if (!watch) return back_to_idle(watch.error());
    if (watch->has_arm_button())
        reply_once(reply, Outcome(nlohmann::json{{"take", name->text()}, {"waits_for", "the arm button"}}));
    if (const Status pressed = wait_for_button(*watch); !pressed) {
        next_look_ = {}, has_failed_in_light_ = true;  // light was to come: what is gone stays a fault
        return back_to_idle(pressed.error());
    }
    if (const Status ready = watch->begin_take(); !ready) return back_to_idle(ready.error());

    auto take = std::make_shared<RunningTake>();
    take->name = name->text(), take->archive = plan.choices.output, take->activity = "take";
    take->seconds_planned = plan.forecast.seconds;
    for (size_t c = 0; c < stage_.cameras.size(); ++c)
        take->target_bytes = std::max(
            take->target_bytes, target_bytes_max(plan.sequence, stage_, c, plan.targets, plan.choices.single_float));
    begin_take(take);
    nlohmann::json watched = nlohmann::json::object();
    const auto report = run_planned(plan, *archives, *watch, reply, watched);
    if (!report) reply_once(reply, Outcome(report.error()));
    end_record(report, *archives, watched);
}

Result<TakeReport> Conductor::run_planned(TakePlan& plan, std::vector<PlannedArchive>& archives, StageWatch& watch,
                                          const Reply& reply, nlohmann::json& watched) {
    const auto take = std::const_pointer_cast<RunningTake>(snapshot().take);
    TakeDescription description{plan.sequence, stage_, plan.calibration, masks_of(plan.choices)};
    description.witness_step = plan.choices.witness_step;
    description.memory.ram_bytes = uint64_t(stage_.daemon.memory_mb) * 1'000'000;
    if (!plan.request.memory_only) description.memory.spill_folder = stage_.daemon.spill;
    description.memory.spill_bytes = uint64_t(stage_.daemon.spill_mb) * 1'000'000;
    TakeSinks sinks;
    sinks.identified = [](const Frame&) {};
    // The first call says that the board plays.
    bool has_begun = false;
    sinks.progress = [&](uint64_t, uint64_t) {
        if (std::exchange(has_begun, true)) return;
        events_.add(EventKind::take_began, fmt::format("take {} began", take->name),
                    {{"take", take->name}, {"archive", take->archive}});
        reply_once(reply, Outcome(nlohmann::json{{"take", take->name}, {"archive", take->archive}}));
    };
    sinks.account = [&] {
        say_notes(watch.end_take());
        return watched = watch.account();
    };
    sinks.monitor = &take->monitor;
    for (PlannedArchive& archive : archives) sinks.outputs.push_back({archive.archive, archive.targets});
    // Clearing gigabytes outlasts the heartbeat of an armed board: behind them it is armed anew.
    const bool stays_armed = stage_.daemon.memory_mb == 0;
    if (!stays_armed)
        if (const Status dark = devices_->make_dark(); !dark) return dark.error();
    return run_take(description, {devices_->board(), devices_->cameras(), stays_armed}, sinks, stop_);
}

void Conductor::end_record(const Result<TakeReport>& report, const std::vector<PlannedArchive>& archives,
                           const nlohmann::json& watched) {
    const auto take = snapshot().take;
    tell_dark(*take);
    if (!report) {
        std::string why = report.error().message;
        if (stop_.wanted && why.find(stop_.why()) == std::string::npos) why += ": " + stop_.why();
        events_.add(EventKind::take_failed, why, {{"take", take->name}});
        // As they are is not known: they are opened anew, and looked at. A board that were still armed would take that for a lost host.
        Status there = Done{};
        if (devices_) (void)devices_->make_dark(), there = devices_->look(false);
        devices_.reset();
        next_look_ = {};
        has_failed_in_light_ = true;
        if (!there) return enter_fault(there.error().message, true);
        return change_state(DaemonState::idle, why);
    }
    const std::string trouble = trouble_of(*report, stop_);
    nlohmann::json account = take_json(*report, archives);
    account["fault"] = trouble;
    account.update(watched);
    account["take"] = take->name;
    account["slots_missing_total"] = report->record.missing().total();
    {
        const std::lock_guard lock(mutex_);
        now_.last_take = account;
    }
    const OutputReport& output = report->outputs[0];
    const uint64_t missing = report->record.missing().total();
    std::string text = fmt::format("take {}: {} targets written, {} missing; {} of {} slots missing", take->name,
                                   output.targets_written, output.targets_missing, missing,
                                   report->record.slots_total * report->record.cameras.size());
    if (missing > 0) text += " (" + report->record.missing().to_words() + ")";
    for (size_t n = 1; n < archives.size(); ++n)
        text +=
            fmt::format("; {}: {} targets written, {} missing", std::filesystem::path(archives[n].path).stem().string(),
                        report->outputs[n].targets_written, report->outputs[n].targets_missing);
    if (stop_.wanted) text += "; " + stop_.why();
    events_.add(EventKind::take_finished, text, account);
    if (!trouble.empty()) return enter_fault(trouble, true);
    change_state(DaemonState::idle);
}

void Conductor::calibrate_now(CardOptions card, const Reply& reply) {
    const std::string folder = stage_.calibration_dir;
    const auto refuse = [&](const Error& why) {
        events_.add(EventKind::calibration_failed, why.message);
        reply_once(reply, Outcome(why));
        next_look_ = {};
        change_state(DaemonState::idle, why.message);
    };
    if (folder.empty())
        return refuse(fail("the stage names no folder for it: add calibration = \"FOLDER\" to it, above its tables"));
    if (card.camera >= stage_.cameras.size())
        return refuse(
            fail(fmt::format("there is no camera {}: the stage has 0 to {}", card.camera, stage_.cameras.size() - 1)));
    if (const Status there = hold_devices(); !there) return refuse(there.error());
    if (const Status dark = devices_->make_dark(); !dark) return refuse(dark.error());
    auto watch = StageWatch::open(stage_, stop_);
    if (!watch) return refuse(watch.error());
    if (const Status ready = watch->begin_take(); !ready) return refuse(ready.error());
    auto take = std::make_shared<RunningTake>();
    take->name = fmt::format("calibration of camera {}", card.camera), take->activity = "calibration";
    begin_take(take);
    reply_once(reply, Outcome(nlohmann::json{{"calibration", folder}, {"camera", card.camera}}));
    const auto measured = calibrate_with_card(
        devices_->board(), *devices_->cameras()[card.camera], stage_, card, stop_, [](uint64_t, uint64_t) {},
        &take->monitor.record());
    tell_dark(*take);
    say_notes(watch->end_take());
    has_failed_in_light_ = !measured;
    if (!measured) return refuse(stop_.wanted ? fail(measured.error().message + ": " + stop_.why()) : measured.error());
    if (const Status kept = write_calibration(folder, card.camera, measured->calibration, measured->record); !kept)
        return refuse(kept.error());
    events_.add(EventKind::calibration_finished, measured->to_text(), measured->to_json(folder));
    change_state(DaemonState::idle);
}

}  // namespace ols
