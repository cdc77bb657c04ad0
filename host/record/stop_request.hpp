// SPDX-License-Identifier: MIT
// That a take is to stop, and why: asked for by the user, or by what watches the stage.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include "record/cause.hpp"

namespace ols {

class StopRequest {
  public:
    // A signal handler may set it: then the reason is the user.
    std::atomic<bool> wanted = false;
    static_assert(std::atomic<bool>::is_always_lock_free, "set in a signal handler");

    // The first reason stays. From any thread.
    void ask(const std::string& why) {
        const std::lock_guard lock(mutex_);
        if (!wanted.exchange(true)) why_ = why;
    }

    // Nothing is wanted any more, before another take begins. Not while anybody heeds it.
    void reset() {
        const std::lock_guard lock(mutex_);
        wanted = false;
        why_.clear();
    }

    // "" while nothing is wanted.
    std::string why() const {
        const std::lock_guard lock(mutex_);
        if (!wanted) return "";
        return why_.empty() ? "stopped by you" : why_;
    }

    Reason reason() const {
        const std::string text = why();
        return text.empty() ? Reason{} : Reason{Cause::stopped, text};
    }

    bool is_by_user() const {
        const std::lock_guard lock(mutex_);
        return wanted && why_.empty();
    }

  private:
    mutable std::mutex mutex_;
    std::string why_;
};

}  // namespace ols
