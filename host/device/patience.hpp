// SPDX-License-Identifier: MIT
// How long a device may take: a bound for each exchange as a whole, by the wall's clock, and one for all that is left to do once
// the user wants to stop.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <optional>
#include <string>

namespace ols {

// When an exchange must be over, however its bytes trickle. Of a Patience that outlives it.
class Deadline;

// For one thread.
class Patience {
  public:
    // An emulated board has its own time, which stands still while it is stopped, and a machine may be busy: an exchange takes
    // milliseconds, and only a board that hangs takes so long.
    static constexpr int exchange_ms = 30'000;
    // For everything from the stop on: telling the board, and reading what is left of its log, at most 1024 entries.
    static constexpr int stop_ms = 10'000;

    // `stop`, where there is one, turns true when the user wants to stop.
    explicit Patience(int one_exchange_ms = exchange_ms, const std::atomic<bool>* stop = nullptr)
        : one_exchange_ms_(one_exchange_ms), stop_(stop) {}

    Deadline begin_exchange();

  private:
    friend class Deadline;
    using Clock = std::chrono::steady_clock;

    Clock::time_point end_after_stop() {
        if (!stop_ || !*stop_) {
            end_after_stop_.reset();  // of a device that outlives one stop
            return Clock::time_point::max();
        }
        if (!end_after_stop_) end_after_stop_ = Clock::now() + std::chrono::milliseconds(stop_ms);
        return *end_after_stop_;
    }

    int one_exchange_ms_;
    const std::atomic<bool>* stop_;
    std::optional<Clock::time_point> end_after_stop_;
};

class Deadline {
  public:
    // A wait is cut into pieces of so long, between which left_ms() looks at the stop.
    static constexpr int look_ms = 50;

    // Milliseconds that are left; 0: it is over.
    int left_ms() const {
        const auto left = std::min(end_, patience_.end_after_stop()) - Clock::now();
        return int(std::max<int64_t>(std::chrono::ceil<std::chrono::milliseconds>(left).count(), 0));
    }
    int next_wait_ms() const { return std::min(left_ms(), look_ms); }

    // "within 30 s", of an exchange that is over.
    std::string text() const;

  private:
    friend class Patience;
    using Clock = Patience::Clock;
    Deadline(Clock::time_point end, Patience& patience) : end_(end), patience_(patience) {}

    Clock::time_point end_;
    Patience& patience_;
};

}  // namespace ols
