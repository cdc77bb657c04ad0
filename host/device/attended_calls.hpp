// SPDX-License-Identifier: MIT
// Calls into a library or the kernel that may never return, made in a thread of their own, in order, and waited for only so long.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace ols {

// What is given up is not undone: such a call goes on, and those after it wait for it. So a call owns what it uses.
class AttendedCalls {
  public:
    explicit AttendedCalls(int patience_ms);
    ~AttendedCalls();  // waits as long as for a call; a thread that hangs stays behind
    AttendedCalls(const AttendedCalls&) = delete;
    AttendedCalls& operator=(const AttendedCalls&) = delete;

    // What `call` returns or throws; nothing when it has not within the patience, or was given up.
    template <typename Call>
    auto run(Call call) -> std::optional<decltype(call())> {
        const auto posted = std::make_shared<Posted<Call>>(std::move(call));
        if (!run_and_wait(posted)) return std::nullopt;
        if (posted->failure) std::rethrow_exception(posted->failure);
        return std::move(posted->answer);
    }

    // Lets those that wait in run() go, from any thread.
    void give_up();

  private:
    struct Work {
        virtual ~Work() = default;
        virtual void run() = 0;
        std::exception_ptr failure;
    };
    template <typename Call>
    struct Posted : Work {
        explicit Posted(Call work) : call(std::move(work)) {}
        void run() override { answer.emplace(call()); }
        Call call;
        std::optional<decltype(call())> answer;
    };
    struct Shared {
        std::mutex mutex;
        std::condition_variable changed;
        std::deque<std::shared_ptr<Work>> calls;
        uint64_t posted = 0, done = 0, given_up = 0;
        bool is_over = false;
    };
    static void serve(const std::shared_ptr<Shared>& shared);
    bool run_and_wait(std::shared_ptr<Work> work);

    const std::chrono::milliseconds patience_;
    const std::shared_ptr<Shared> shared_;
    std::thread thread_;
};

}  // namespace ols
