// SPDX-License-Identifier: MIT
// LibraryThread: a thread for the calls of a library, or of the kernel, that may wait for ever on a device. Whoever makes a call waits
// for a bounded time; a call that hangs is left behind with all that it holds, and what is asked for after it is not answered either.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>

namespace ols {

// All functions from any thread. A call owns what it touches (by shared pointers): it may outlive whoever made it.
class LibraryThread {
  public:
    // `end_patience_ms`: for how long its end waits for everything that was posted.
    explicit LibraryThread(int end_patience_ms = 10'000);
    ~LibraryThread();

    // Makes the call after those before it, and waits for nothing.
    void post(std::function<void()> call);

    // Its end waits for nothing any more: what its calls wait for is known to have gone.
    void leave_behind() { end_patience_ms_ = 0; }

    // Calls `tick` whenever nothing else was asked for in so long.
    void set_tick(std::function<void()> tick, int period_ms);

    // What `call` returns; nothing when it has not within `patience_ms`, or when `give_up` turned true meanwhile.
    template <typename Call>
    std::optional<std::invoke_result_t<Call>> run(
        Call call, int patience_ms, const std::function<bool()>& give_up = [] { return false; }) {
        using Returned = std::invoke_result_t<Call>;
        const auto task = std::make_shared<std::packaged_task<Returned()>>(std::move(call));
        auto returned = task->get_future();
        post([task] { (*task)(); });
        constexpr int look_ms = 10;
        for (int waited_ms = 0;; waited_ms += look_ms) {
            if (returned.wait_for(std::chrono::milliseconds(look_ms)) == std::future_status::ready)
                return returned.get();
            if (waited_ms >= patience_ms || give_up()) return std::nullopt;
        }
    }

  private:
    struct Shared;
    static void work(Shared& shared);
    const std::shared_ptr<Shared> shared_;
    std::atomic<int> end_patience_ms_;
};

}  // namespace ols
