// SPDX-License-Identifier: MIT
// One thread follows the inputs, by their edges and, where edges were dropped, by their levels.
#include "device/stage_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "exceptions.hpp"
#include "steady_clock.hpp"

namespace ols {

namespace {

constexpr int look_ms = 20;  // at levels, and at whether the take is to stop
constexpr const char* use_names[] = {"arm", "emergency_stop", "genlock"};

}  // namespace

bool DebouncedLevel::set(bool active, uint64_t time_ns) {
    const bool has_changed = advance(time_ns);
    if (active != candidate_) {
        candidate_ = active;
        since_ns_ = time_ns;
    }
    return advance(time_ns) || has_changed;
}

bool DebouncedLevel::advance(uint64_t now_ns) {
    if (candidate_ == level_ || now_ns < since_ns_ + hold_ns_) return false;
    level_ = candidate_;
    return true;
}

std::vector<GpioLineSetup> StageLines::inputs_of(const GpioSetup& setup) {
    std::vector<GpioLineSetup> inputs;
    for (const auto& input : {setup.arm, setup.emergency_stop, setup.genlock})
        if (input) inputs.push_back(*input);
    return inputs;
}

std::vector<GpioLineSetup> StageLines::outputs_of(const GpioSetup& setup) {
    return setup.tally ? std::vector{*setup.tally} : std::vector<GpioLineSetup>();
}

Result<std::unique_ptr<StageLines>> StageLines::open(const GpioSetup& setup, OnStop on_stop) {
    auto lines = open_gpio(setup.chip, inputs_of(setup), outputs_of(setup));
    if (!lines.ok()) return lines.error();
    return std::make_unique<StageLines>(std::move(*lines), setup, std::move(on_stop));
}

StageLines::StageLines(std::unique_ptr<GpioLines> lines, const GpioSetup& setup, OnStop on_stop)
    : setup_(setup), on_stop_(std::move(on_stop)), lines_(std::move(lines)) {
    add_input(arm, setup.arm);
    add_input(emergency_stop, setup.emergency_stop);
    add_input(genlock, setup.genlock);
    if (const auto levels = lines_->levels(); !levels.ok()) {
        note_trouble(levels.error().message);
    } else {
        for (size_t n = 0; n < inputs_.size(); ++n)
            inputs_[n].level = DebouncedLevel((*levels)[n], uint64_t(inputs_[n].setup.debounce_ms) * 1'000'000);
        look(*levels, steady_ns());
    }
    thread_ = std::thread([this] {
        const Status watched = guarded("the GPIO lines cannot be followed", [this] { return watch(), Status(Done{}); });
        if (watched.ok()) return;
        const std::lock_guard lock(mutex_);
        note_trouble(watched.error().message);
    });
}

StageLines::~StageLines() {
    end_take();
    {
        const std::lock_guard lock(mutex_);
        end_ = true;
    }
    thread_.join();
}

void StageLines::add_input(Use use, const std::optional<GpioLineSetup>& setup) {
    if (setup) inputs_.push_back({use, *setup, {}, DebouncedLevel(false, 0)});
}

void StageLines::watch() {
    for (;;) {
        const auto edges = lines_->wait(look_ms);
        const bool is_quiet = edges.ok() && edges->empty();
        const auto levels = is_quiet ? lines_->levels() : Result<std::vector<bool>>(std::vector<bool>());
        const uint64_t now = steady_ns();
        const std::lock_guard lock(mutex_);
        if (end_) return;
        if (!edges.ok() || !levels.ok()) return note_trouble((edges.ok() ? levels.error() : edges.error()).message);
        for (const GpioEdge& edge : *edges) take_edge(edge);
        if (is_quiet) look(*levels, now);
        if (stop_ && *stop_ && is_lit_) (void)set_tally(false);
    }
}

void StageLines::take_edge(const GpioEdge& edge) {
    Input& input = inputs_[edge.input];
    input.account.add(edge.active);
    input.last_edge_ns = edge.time_ns;
    follow_level(input, input.level.set(edge.active, edge.time_ns));
}

void StageLines::look(const std::vector<bool>& levels, uint64_t now) {
    for (size_t n = 0; n < inputs_.size(); ++n) {
        inputs_[n].account.look(levels[n]);
        follow_level(inputs_[n], inputs_[n].level.set(levels[n], now));
    }
}

// An emergency stop holds whatever comes after it, and needs no edge: its level is enough.
void StageLines::follow_level(Input& input, bool has_changed) {
    if (input.use == emergency_stop && input.level.active())
        note_trouble(
            fmt::format("emergency stop: {} is active (the button was pressed, or its wire is open): release it when "
                        "the stage is safe",
                        describe(input)));
    if (input.use == arm && has_changed && input.level.active()) {
        ++presses_;
        changed_.notify_all();
    }
    if (input.use == genlock && has_changed && !input.level.active() && is_taking_) {
        if (setup_.genlock_absence == GenlockAbsence::stops)
            note_trouble(genlock_absent());
        else
            warnings_.push_back(genlock_absent());
    }
}

void StageLines::note_trouble(const std::string& why) {
    if (!trouble_.empty()) return;
    trouble_ = why;
    if (is_taking_) {
        on_stop_(why);
        (void)set_tally(false);
    }
    changed_.notify_all();
}

// Empty while the signal is there, or is not looked for.
std::string StageLines::genlock_absent() const {
    for (const Input& input : inputs_)
        if (input.use == genlock && !input.level.active())
            return fmt::format("genlock is absent: {} is not active: check the sync generator and its cable",
                               describe(input));
    return "";
}

std::string StageLines::describe(const Input& input) const {
    return fmt::format("line '{}' of {}", input.setup.line, lines_->name());
}

Status StageLines::set_tally(bool lit) {
    if (!setup_.tally || lit == is_lit_) return Done{};
    is_lit_ = lit;
    const Status set = lines_->set(0, lit);
    if (!set.ok()) warnings_.push_back("the tally light cannot be switched: " + set.error().message);
    return set;
}

Status StageLines::wait_for_arm(const std::atomic<bool>& stop, const std::function<Status()>& meanwhile) {
    std::unique_lock lock(mutex_);
    const uint64_t presses_before = presses_;
    while (trouble_.empty() && presses_ == presses_before) {
        if (stop) return fail("stopped before the arm button was pressed");
        changed_.wait_for(lock, std::chrono::milliseconds(look_ms));
        if (!meanwhile) continue;
        lock.unlock();
        const Status goes_on = meanwhile();
        lock.lock();
        if (!goes_on.ok()) return goes_on;
    }
    if (!trouble_.empty()) return fail(trouble_);
    return Done{};
}

Status StageLines::begin_take(const std::atomic<bool>& stop) {
    const std::lock_guard lock(mutex_);
    if (!trouble_.empty()) return fail(trouble_);
    if (const std::string absent = genlock_absent(); !absent.empty()) {
        if (setup_.genlock_absence == GenlockAbsence::stops) return fail(absent);
        warnings_.push_back(absent);
    }
    if (const Status lit = set_tally(true); !lit.ok()) return lit;
    is_taking_ = true;
    stop_ = &stop;
    return Done{};
}

void StageLines::end_take() {
    const std::lock_guard lock(mutex_);
    is_taking_ = false;
    stop_ = nullptr;
    (void)set_tally(false);
}

std::vector<LineReport> StageLines::report() const {
    const std::lock_guard lock(mutex_);
    std::vector<LineReport> lines;
    for (const Input& input : inputs_)
        lines.push_back(
            {use_names[input.use], input.setup.line, input.account.seen(), input.account.lost(), input.last_edge_ns});
    return lines;
}

std::vector<std::string> StageLines::warnings() const {
    const std::lock_guard lock(mutex_);
    return warnings_;
}

}  // namespace ols
