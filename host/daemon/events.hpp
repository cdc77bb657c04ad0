// SPDX-License-Identifier: MIT
// Events: what happens to the daemon, each with a number, a code for its kind, and words; kept, told to subscribers, and logged.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace ols {

// Codes never change their meaning: 1xx the daemon, 2xx devices, 3xx takes, 4xx the disk, 5xx clients.
enum class EventKind {
    daemon_started = 101,
    daemon_stopping = 102,
    configuration_read = 103,
    configuration_wrong = 104,
    pipeline_stuck = 105,
    state_changed = 201,
    devices_ready = 202,
    fault = 203,
    fault_over = 204,
    dark = 205,
    stop_asked = 206,
    not_dark = 207,
    armed = 301,
    take_began = 302,
    take_progress = 303,
    take_finished = 304,
    take_failed = 305,
    slots_missing = 306,
    sequence_swapped = 307,
    calibration_finished = 308,
    calibration_failed = 309,
    waits_for_button = 310,
    note = 311,
    disk_short = 401,
    disk_full = 402,
    disk_failed = 403,
    client_refused = 501,
    client_dropped = 502,
};

enum class EventLevel { debug, info, warning, error };

struct EventKindFacts {
    EventKind kind;
    const char* name;  // "take_began"
    EventLevel level;
    const char* meaning;
};
// All of them, by code (docs/operating.md has this table, and a test holds them together).
std::span<const EventKindFacts> event_kinds();
const EventKindFacts& facts_of(EventKind kind);
const char* level_name(EventLevel level);

struct Event {
    uint64_t number = 0;  // from 1, without gaps
    int64_t utc_ms = 0;   // since 1970; for people alone
    EventKind kind = EventKind::note;
    std::string text;
    nlohmann::json data;

    // {"number", "time", "code", "event", "level", "text", "data"}
    nlohmann::json to_json() const;
};

// "2026-05-01T12:00:00.123Z".
std::string utc_text(int64_t utc_ms);

// For any thread.
class EventLog {
  public:
    using Listener = std::function<void(const Event&)>;

    // `logger` is told each event that is not of level debug, in order; such events are kept, the last `kept_max` of them.
    explicit EventLog(Listener logger) : logger_(std::move(logger)) {}

    void add(EventKind kind, std::string text, nlohmann::json data = nlohmann::json::object());

    // Calls `listener` for each later event, in order; it must not wait and not call back. The number of the last event before.
    struct Subscription {
        uint64_t id = 0, last_number = 0;
    };
    Subscription subscribe(Listener listener);
    void unsubscribe(uint64_t id);

    // Kept events with a number above `after`, the last `limit` of them.
    std::vector<Event> since(uint64_t after, size_t limit) const;
    uint64_t last_number() const;
    std::map<EventKind, uint64_t> counts() const;  // since the start, those of level debug too

    static constexpr size_t kept_max = 2000;

  private:
    const Listener logger_;
    mutable std::mutex mutex_;
    uint64_t last_number_ = 0, last_id_ = 0;
    std::deque<Event> kept_;
    std::map<EventKind, uint64_t> counts_;
    std::map<uint64_t, Listener> listeners_;
};

}  // namespace ols
