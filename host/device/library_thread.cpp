// SPDX-License-Identifier: MIT
// The queue of calls and the thread that makes them.
#include "device/library_thread.hpp"

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

namespace ols {

struct LibraryThread::Shared {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<std::function<void()>> calls;
    std::function<void()> tick;
    std::chrono::milliseconds period = std::chrono::hours(1);
    bool ending = false, ended = false;
};

LibraryThread::LibraryThread(int end_patience_ms)
    : shared_(std::make_shared<Shared>()), end_patience_ms_(end_patience_ms) {
    std::thread([shared = shared_] { work(*shared); }).detach();
}

LibraryThread::~LibraryThread() {
    std::unique_lock lock(shared_->mutex);
    shared_->ending = true;
    shared_->tick = nullptr;
    shared_->changed.notify_all();
    shared_->changed.wait_for(lock, std::chrono::milliseconds(end_patience_ms_), [this] { return shared_->ended; });
}

void LibraryThread::post(std::function<void()> call) {
    const std::lock_guard lock(shared_->mutex);
    shared_->calls.push_back(std::move(call));
    shared_->changed.notify_all();
}

void LibraryThread::set_tick(std::function<void()> tick, int period_ms) {
    const std::lock_guard lock(shared_->mutex);
    shared_->tick = std::move(tick);
    shared_->period = std::chrono::milliseconds(period_ms);
    shared_->changed.notify_all();
}

void LibraryThread::work(Shared& shared) {
    std::unique_lock lock(shared.mutex);
    for (;;) {
        if (shared.calls.empty() && shared.ending) break;
        const bool is_asked =
            shared.changed.wait_for(lock, shared.period, [&] { return !shared.calls.empty() || shared.ending; });
        std::function<void()> call;
        if (is_asked && !shared.calls.empty()) {
            call = std::move(shared.calls.front());
            shared.calls.pop_front();
        } else {
            call = shared.tick;
        }
        if (!call) continue;
        lock.unlock();
        call();
        call = nullptr;  // lets go of what it held, here
        lock.lock();
    }
    shared.ended = true;
    shared.changed.notify_all();
}

}  // namespace ols
