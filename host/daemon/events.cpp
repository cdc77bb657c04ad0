// SPDX-License-Identifier: MIT
// The table of event kinds, and the log.
#include "daemon/events.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace ols {

namespace {

using enum EventKind;
using enum EventLevel;

const std::vector<EventKindFacts> table = {
    {daemon_started, "daemon_started", info, "it runs and listens"},
    {daemon_stopping, "daemon_stopping", info, "it was told to end, and finishes what it holds"},
    {configuration_read, "configuration_read", info, "the configuration was read anew and is in force"},
    {configuration_wrong, "configuration_wrong", error,
     "file and line of what is wrong; the one before stays in force"},
    {pipeline_stuck, "pipeline_stuck", error, "a stage of the pipeline does not advance; systemd is no longer fed"},
    {state_changed, "state_changed", info, "the state, and the one before"},
    {devices_ready, "devices_ready", info, "board and cameras answer"},
    {fault, "fault", error, "what is wrong and what to do"},
    {fault_over, "fault_over", info, "cleared, or its cause has gone while nothing was running"},
    {dark, "dark", info, "the board's own word that its lamps are off, and how long after a stop"},
    {stop_asked, "stop_asked", info, "by whom or what"},
    {not_dark, "not_dark", error, "the board did not confirm that it is dark: use the emergency stop"},
    {armed, "armed", info, "the sequence is in the board, cameras are set up, the disk has room"},
    {take_began, "take_began", info, "light is on; the archive's name"},
    {take_progress, "take_progress", debug, "twice a second: frames, slots, targets, how far behind"},
    {take_finished, "take_finished", info, "the archive is finished; what is missing of it, by cause"},
    {take_failed, "take_failed", error, "there is no archive, and why"},
    {slots_missing, "slots_missing", warning, "slots of the running take without a frame, by cause, so far"},
    {sequence_swapped, "sequence_swapped", info, "another sequence is in force"},
    {calibration_finished, "calibration_finished", info, "black level and flat field are measured and in force"},
    {calibration_failed, "calibration_failed", error, "nothing was written, and why"},
    {waits_for_button, "waits_for_button", info, "the arm button begins the take"},
    {note, "note", warning, "what a person should know of a take, in words"},
    {disk_short, "disk_short", error, "the disk has no room for the take that was asked for; how much would fit"},
    {disk_full, "disk_full", error, "the disk came to its reserve: the take was ended, and finishes what it has"},
    {disk_failed, "disk_failed", error,
     "the takes' disk takes no more: the take was ended, and what is on the disk stays"},
    {client_refused, "client_refused", warning, "a token or a request that was not right; a few a minute are told"},
    {client_dropped, "client_dropped", warning, "a subscriber that did not read was let go of"},
};

}  // namespace

std::span<const EventKindFacts> event_kinds() {
    return table;
}

const EventKindFacts& facts_of(EventKind kind) {
    return *std::ranges::find(table, kind, &EventKindFacts::kind);
}

const char* level_name(EventLevel level) {
    switch (level) {
        case debug: return "debug";
        case info: return "info";
        case warning: return "warning";
        case error: return "error";
    }
    return "";
}

std::string utc_text(int64_t utc_ms) {
    return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(std::time_t(utc_ms / 1000)), utc_ms % 1000);
}

nlohmann::json Event::to_json() const {
    const EventKindFacts& facts = facts_of(kind);
    return {{"number", number},    {"time", utc_text(utc_ms)},         {"code", int(kind)},
            {"event", facts.name}, {"level", level_name(facts.level)}, {"text", text},
            {"data", data}};
}

void EventLog::add(EventKind kind, std::string text, nlohmann::json data) {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const std::lock_guard lock(mutex_);
    Event event{++last_number_, std::chrono::duration_cast<std::chrono::milliseconds>(now).count(), kind,
                std::move(text), std::move(data)};
    ++counts_[kind];
    for (const auto& [id, listener] : listeners_) listener(event);
    if (facts_of(kind).level == debug) return;
    if (logger_) logger_(event);
    kept_.push_back(std::move(event));
    if (kept_.size() > kept_max) kept_.pop_front();
}

EventLog::Subscription EventLog::subscribe(Listener listener) {
    const std::lock_guard lock(mutex_);
    listeners_.emplace(++last_id_, std::move(listener));
    return {last_id_, last_number_};
}

void EventLog::unsubscribe(uint64_t id) {
    const std::lock_guard lock(mutex_);
    listeners_.erase(id);
}

std::vector<Event> EventLog::since(uint64_t after, size_t limit) const {
    const std::lock_guard lock(mutex_);
    auto first = std::ranges::upper_bound(kept_, after, {}, &Event::number);
    if (size_t(kept_.end() - first) > limit) first = kept_.end() - std::ptrdiff_t(limit);
    return {first, kept_.end()};
}

uint64_t EventLog::last_number() const {
    const std::lock_guard lock(mutex_);
    return last_number_;
}

std::map<EventKind, uint64_t> EventLog::counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
}

}  // namespace ols
