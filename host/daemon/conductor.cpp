// SPDX-License-Identifier: MIT
// States, jobs, and the devices between takes. What a take does: conduct_take.cpp.
#include "daemon/conductor.hpp"

#include <fmt/format.h>

#include <utility>

#include "exceptions.hpp"

namespace ols {

namespace {

// For what has begun to be over, from a stop on: the board has Patience::stop_ms for it, and then it is known not to answer.
constexpr std::chrono::milliseconds dark_patience(Patience::stop_ms + 2000);

double ms_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

// What is opened once, at the start.
Status check_lasting(const DaemonSetup& before, const DaemonSetup& now) {
    const char* const changed = now.socket != before.socket               ? "socket"
                                : now.socket_group != before.socket_group ? "socket_group"
                                : now.http_port != before.http_port       ? "http_port"
                                : now.token_file != before.token_file     ? "token_file"
                                                                          : nullptr;
    if (!changed) return Done{};
    return fail(now.places.at(changed) + " has changed: that takes a restart of the daemon");
}

}  // namespace

Conductor::Conductor(std::string config_path, StageConfig stage, EventLog& events)
    : config_path_(std::move(config_path)), events_(events), stage_(std::move(stage)) {
    now_.sequence = stage_.daemon.sequence;
    now_.totals.know(stage_);
    look_at_devices();  // nobody is told that all is well before it was looked at
    thread_ = std::thread([this] { work(); });
}

Conductor::~Conductor() {
    shut_down([] {});
}

void TakeTotals::know(const StageConfig& stage) {
    for (uint32_t index = 0; index < stage.cameras.size(); ++index) cameras[index];
}

void TakeTotals::add(const TakeProgress& progress) {
    triggers += progress.record.board.triggers_fired;
    for (const CameraProgress& camera : progress.record.cameras) {
        cameras[camera.index].frames += camera.frames_received;
        cameras[camera.index].missing.add(camera.missing);
    }
    for (const OutputProgress& output : progress.outputs)
        targets_written += output.targets_written, targets_missing += output.targets_missing;
}

Snapshot Conductor::snapshot() const {
    const std::lock_guard lock(mutex_);
    Snapshot now = now_;
    now.is_busy = bool(job_);
    return now;
}

StageConfig Conductor::stage() const {
    const std::lock_guard lock(mutex_);
    return stage_;
}

void Conductor::work() {
    for (;;) {
        std::function<void()> job;
        {
            std::unique_lock lock(mutex_);
            changed_.wait_until(lock, next_look_, [&] { return job_ || ends_; });
            if (ends_ && !job_) break;
            job = job_;
        }
        if (!job) {
            look_at_devices();
            next_look_ = Clock::now() + look_pause;
            continue;
        }
        const Status done = guarded("the daemon gave up what it did", [&] { return job(), Status(Done{}); });
        if (!done) give_up(done.error().message);
        job = {};
        const std::lock_guard lock(mutex_);
        job_ = {};
        stop_.reset();  // or it would cut short what is asked of the board from now on
        changed_.notify_all();
    }
    if (devices_) (void)devices_->make_dark();
    devices_.reset();
}

// What was under way ended with an exception: where it was is not known.
void Conductor::give_up(const std::string& why) {
    if (devices_) (void)devices_->make_dark();
    devices_.reset();
    next_look_ = {}, has_failed_in_light_ = true;
    if (const auto take = snapshot().take) {
        const bool is_take = take->activity == "take";
        events_.add(is_take ? EventKind::take_failed : EventKind::calibration_failed, why, {{"take", take->name}});
    }
    enter_fault(why, true);
}

std::future<Conductor::Outcome> Conductor::begin_job(const std::string& what, std::function<void(const Reply&)> job) {
    const auto reply = std::make_shared<std::promise<Outcome>>();
    job_name_ = what;
    job_ = [job = std::move(job), reply] { job(reply); };
    changed_.notify_all();
    return reply->get_future();
}

Conductor::Outcome Conductor::reply_of(std::future<Outcome> replied, const std::string& what) {
    try {
        return replied.get();
    } catch (const std::future_error&) {  // the job ended without a reply: an exception, which is told as a fault
        return fail(what + " failed: `stagectl log` says why");
    }
}

Conductor::Outcome Conductor::run(const std::string& method, const std::string& what,
                                  std::function<void(const Reply&)> job) {
    const auto allowed_job = [this, method = find_method(method), job = std::move(job)](const Reply& reply) {
        const DaemonState state = snapshot().state;
        if (method->is_allowed(state)) return job(reply);
        reply->set_value(fail(fmt::format("{} is for the states {}, and the stage has come into state {}", method->name,
                                          state_words(method->allowed), ols::state_name(state))));
    };
    std::future<Outcome> replied;
    {
        const std::lock_guard lock(mutex_);
        if (ends_) return fail("the daemon is ending");
        if (job_) return fail(fmt::format("the stage is busy: {} is under way; try again when it is over", job_name_));
        stop_.reset();
        replied = begin_job(what, allowed_job);
    }
    return reply_of(std::move(replied), what);
}

// Events of the state come in the order of its changes: whatever thread changes it tells it before another can.
void Conductor::change_state(DaemonState state, const std::string& text, std::optional<DaemonState> from) {
    const std::lock_guard lock(mutex_);
    const DaemonState before = now_.state;
    if (from && before != *from) return;
    now_.state = state;
    if (state != DaemonState::fault) now_.fault.clear(), now_.fault_is_latched = false;
    if (state == DaemonState::idle || state == DaemonState::fault) {
        if (now_.take) now_.totals.add(now_.take->monitor.progress());
        now_.plan = nullptr, now_.take = nullptr;
    }
    changed_.notify_all();
    if (before == state) return;
    events_.add(EventKind::state_changed, fmt::format("{}{}{}", ols::state_name(state), text.empty() ? "" : ": ", text),
                {{"state", ols::state_name(state)}, {"before", ols::state_name(before)}});
}

void Conductor::enter_fault(const std::string& why, bool is_latched) {
    {
        const std::lock_guard lock(mutex_);
        const bool is_in_fault = now_.state == DaemonState::fault;
        if (is_in_fault && now_.fault_is_latched && !is_latched) return;  // who looks is to see what came first
        const bool is_known = is_in_fault && now_.fault == why;
        now_.fault = why;
        now_.fault_is_latched |= is_latched;
        if (is_known) return;
    }
    plan_.reset();
    events_.add(EventKind::fault, why, {{"latched", is_latched}});
    change_state(DaemonState::fault, why);
}

Status Conductor::hold_devices() {
    if (devices_) return Done{};
    auto opened = StageDevices::open(stage_, stop_);
    if (!opened) return opened.error();
    devices_ = std::move(*opened);
    if (const Status dark = darken_found(); !dark) return devices_.reset(), dark;
    const std::string account = devices_->account();
    {
        const std::lock_guard lock(mutex_);
        now_.devices = account;
    }
    events_.add(EventKind::devices_ready, account);
    return Done{};
}

// A board that is opened may play what a program left to it that was killed: its heartbeat is any word, ours, too.
Status Conductor::darken_found() {
    const auto found = devices_->board().status();
    if (!found.ok()) return found.error();
    if (const Status dark = devices_->make_dark(); !dark) return dark;
    if (found->state == OLS_STATE_PLAYING || found->state == OLS_STATE_WAITING)
        events_.add(EventKind::dark, "the board was playing when it was opened, and says now that it is dark");
    return Done{};
}

// While nothing runs: a device that has gone is a fault, which ends by itself when all are back, unless it went in light, or light was to
// come.
void Conductor::look_at_devices() {
    const Snapshot before = snapshot();
    const bool is_armed = before.state == DaemonState::armed;
    const bool was_in_light = std::exchange(has_failed_in_light_, false) || is_armed;
    Status there = hold_devices();
    if (there) there = devices_->look(is_armed);
    if (!there) {
        devices_.reset();
        {
            const std::lock_guard lock(mutex_);
            now_.devices.clear();
        }
        return enter_fault(there.error().message, was_in_light);
    }
    if (before.state != DaemonState::fault || before.fault_is_latched) return;
    events_.add(EventKind::fault_over, "board and cameras answer again");
    change_state(DaemonState::idle);
}

Conductor::Outcome Conductor::arm(const TakeRequest& request) {
    return run("arm", "arming", [this, request](const Reply& reply) {
        const Status armed = arm_now(request);
        reply->set_value(armed ? Outcome(plan_->to_json()) : Outcome(armed.error()));
    });
}

Conductor::Outcome Conductor::record(const TakeRequest& request) {
    return run("record", "a take", [this, request](const Reply& reply) { record_now(request, reply); });
}

Conductor::Outcome Conductor::calibrate(const CardOptions& card) {
    return run("calibrate", "a calibration", [this, card](const Reply& reply) { calibrate_now(card, reply); });
}

Conductor::Outcome Conductor::swap(const std::string& sequence_name) {
    return run("swap", "a swap of sequences", [this, sequence_name](const Reply& reply) {
        TakeRequest request = plan_ ? plan_->request : TakeRequest{};
        if (const auto fits = plan_take(request, sequence_name, stage_); !fits) return reply->set_value(fits.error());
        const std::string before = snapshot().sequence;
        const auto set_sequence = [&](const std::string& name) {
            const std::lock_guard lock(mutex_);
            now_.sequence = name;
        };
        set_sequence(sequence_name);
        if (plan_)
            if (const Status armed = arm_now(request); !armed)
                return set_sequence(before), reply->set_value(armed.error());
        events_.add(EventKind::sequence_swapped, "takes are recorded with sequence " + sequence_name,
                    {{"sequence", sequence_name}});
        reply->set_value(nlohmann::json{{"sequence", sequence_name}, {"armed", plan_.has_value()}});
    });
}

Conductor::Outcome Conductor::clear_fault() {
    return run("clear_fault", "the end of a fault", [this](const Reply& reply) {
        if (snapshot().state != DaemonState::fault) return reply->set_value(nlohmann::json{{"state", "idle"}});
        devices_.reset();
        Status there = hold_devices();
        if (there)
            if (const auto status = devices_->board().status(); status.ok() && status->state == OLS_STATE_FAULT)
                there = devices_->board().clear_fault();
        if (there) there = devices_->look(false);
        if (!there) {
            devices_.reset();
            enter_fault(there.error().message, true);
            return reply->set_value(there.error());
        }
        events_.add(EventKind::fault_over, "the fault was cleared");
        change_state(DaemonState::idle);
        reply->set_value(nlohmann::json{{"state", "idle"}});
    });
}

Conductor::Outcome Conductor::reload() {
    return run("reload", "a reading of the configuration", [this](const Reply& reply) {
        auto read = read_stage(config_path_);
        Status fits = Done{};
        if (read) fits = check_lasting(stage_.daemon, read->daemon);
        if (read && fits) fits = check_daemon(*read, true);
        if (!read || !fits) {
            const Error& wrong = read ? fits.error() : read.error();
            events_.add(EventKind::configuration_wrong, wrong.message + "; the configuration before stays in force");
            return reply->set_value(wrong);
        }
        devices_.reset();
        {
            const std::lock_guard lock(mutex_);
            stage_ = *read;
            now_.totals.know(stage_);
            now_.sequence = stage_.daemon.sequence;
            now_.devices.clear();
        }
        events_.add(EventKind::configuration_read, "'" + config_path_ + "' is in force");
        next_look_ = {};
        reply->set_value(nlohmann::json{{"configuration", config_path_}});
    });
}

// The board is the running take's: it is told through it, and its word is in the take's account. What else is under way is cut short
// (arming, a look at a board that hangs), and then the board is told and asked by this thread.
Conductor::Outcome Conductor::stop(const std::string& by) {
    const auto asked = Clock::now();
    std::unique_lock lock(mutex_);
    const auto has_dark_take = [&] {
        return now_.take && now_.take->monitor.progress().record.board.dark_confirmed_ns != 0;
    };
    // A take that is dark has nothing to stop: what it holds is finished.
    if (!has_dark_take()) stop_.ask("stopped by " + by);  // before anybody is told of it
    events_.add(EventKind::stop_asked, "stop asked for by " + by, {{"by", by}});
    while (job_ && !has_dark_take() && Clock::now() - asked < dark_patience) {
        stop_.ask("stopped by " + by);
        changed_.wait_for(lock, std::chrono::milliseconds(2));
    }
    if (has_dark_take()) return nlohmann::json{{"dark", true}, {"after_ms", ms_since(asked)}};
    if (!job_ && ends_) return fail("the daemon is ending, and darkens the board itself");
    if (!job_) {
        stop_.ask("stopped by " + by);
        auto replied = begin_job("a stop", [=, this](const Reply& reply) { reply->set_value(darken(by, asked)); });
        lock.unlock();
        if (replied.wait_until(asked + dark_patience) == std::future_status::ready)
            return reply_of(std::move(replied), "a stop");
    } else {
        lock.unlock();
    }
    const std::string why = fmt::format(
        "the board did not confirm within {:.0f} ms that it is dark: use the emergency stop", ms_since(asked));
    events_.add(EventKind::not_dark, why);
    return fail(why);
}

Conductor::Outcome Conductor::darken(const std::string& by, Clock::time_point asked) {
    // The board without the cameras, where these are not held: one that has gone keeps nobody from putting the light out.
    const Status dark = [&]() -> Status {
        if (devices_) return devices_->make_dark();
        auto board = StageDevices::open_board(stage_, stop_);
        return board ? StageDevices::make_dark(*board) : Status(board.error());
    }();
    if (!dark) {
        const std::string why =
            "the board did not confirm that it is dark: use the emergency stop if there is light; " +
            dark.error().message;
        events_.add(EventKind::not_dark, why);
        return fail(why);
    }
    const double after_ms = ms_since(asked);
    events_.add(EventKind::dark, "the board says that it is dark", {{"after_ms", after_ms}, {"by", by}});
    plan_.reset();
    if (snapshot().state == DaemonState::armed) change_state(DaemonState::idle, "stopped by " + by);
    return nlohmann::json{{"dark", true}, {"after_ms", after_ms}};
}

void Conductor::end_take(EventKind kind, const std::string& why) {
    {
        const std::lock_guard lock(mutex_);
        if (!job_ || stop_.wanted) return;
        stop_.ask(why);
    }
    events_.add(kind, why);
}

void Conductor::shut_down(const std::function<void()>& progress) {
    {
        std::unique_lock lock(mutex_);
        ends_ = true;
        if (job_) stop_.ask("stopped as the daemon was told to end");
        changed_.notify_all();
        while (job_) {
            changed_.wait_for(lock, std::chrono::milliseconds(250));
            lock.unlock();
            progress();
            lock.lock();
        }
    }
    if (thread_.joinable()) thread_.join();
}

}  // namespace ols
