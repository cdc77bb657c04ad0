// SPDX-License-Identifier: MIT
// Subscriber: events that wait for one client to take them, of whom it is known when it has stopped reading.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

#include "daemon/events.hpp"

namespace ols {

class Subscriber {
  public:
    // Events from here on. At most `waiting_max` wait; a client that is behind by more has lost some, and is to be let go of: it
    // comes again, and gets the present state.
    explicit Subscriber(EventLog& events) : events_(events) {
        subscription_ = events_.subscribe([this](const Event& event) {
            const std::lock_guard lock(mutex_);
            if (waiting_.size() >= waiting_max)
                is_behind_ = true;
            else
                waiting_.push_back(event);
            came_.notify_all();
        });
    }
    ~Subscriber() { events_.unsubscribe(subscription_.id); }
    Subscriber(const Subscriber&) = delete;

    // The next event, or nothing within `timeout`.
    std::optional<Event> next(std::chrono::milliseconds timeout) {
        std::unique_lock lock(mutex_);
        if (!came_.wait_for(lock, timeout, [&] { return !waiting_.empty() || is_behind_; })) return std::nullopt;
        if (waiting_.empty()) return std::nullopt;
        Event event = std::move(waiting_.front());
        waiting_.pop_front();
        return event;
    }
    bool is_behind() const {
        const std::lock_guard lock(mutex_);
        return is_behind_;
    }

    static constexpr size_t waiting_max = 1000;

  private:
    EventLog& events_;
    mutable std::mutex mutex_;
    std::condition_variable came_;
    std::deque<Event> waiting_;
    bool is_behind_ = false;
    EventLog::Subscription subscription_;
};

}  // namespace ols
