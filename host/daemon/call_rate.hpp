// SPDX-License-Identifier: MIT
// How often one client may call: so many at once, and so many a second after that.
#pragma once

#include <algorithm>
#include <chrono>

namespace ols {

// A token bucket. For one thread.
class CallRate {
  public:
    static constexpr double calls_at_once = 100, calls_a_second = 50;

    // How long the call that comes now must wait.
    std::chrono::milliseconds take() {
        const auto now = Clock::now();
        left_ = std::min(calls_at_once, left_ + std::chrono::duration<double>(now - last_).count() * calls_a_second);
        last_ = now;
        left_ -= 1;
        return std::chrono::milliseconds(left_ >= 0 ? 0 : int64_t(-left_ / calls_a_second * 1000));
    }

  private:
    using Clock = std::chrono::steady_clock;
    double left_ = calls_at_once;
    Clock::time_point last_ = Clock::now();
};

}  // namespace ols
