// SPDX-License-Identifier: MIT
// One thread and a queue, kept alive by whoever of the two ends lives longer.
#include "device/attended_calls.hpp"

namespace ols {

AttendedCalls::AttendedCalls(int patience_ms)
    : patience_(patience_ms), shared_(std::make_shared<Shared>()), thread_([shared = shared_] { serve(shared); }) {}

AttendedCalls::~AttendedCalls() {
    bool is_idle = false;
    {
        std::unique_lock lock(shared_->mutex);
        shared_->is_over = true;
        shared_->changed.notify_all();
        is_idle = shared_->changed.wait_for(lock, patience_, [&] { return shared_->done == shared_->posted; });
    }
    if (is_idle)
        thread_.join();
    else
        thread_.detach();
}

void AttendedCalls::serve(const std::shared_ptr<Shared>& shared) {
    std::unique_lock lock(shared->mutex);
    for (;;) {
        shared->changed.wait(lock, [&] { return shared->is_over || !shared->calls.empty(); });
        if (shared->calls.empty()) return;
        auto work = std::move(shared->calls.front());
        shared->calls.pop_front();
        lock.unlock();
        try {
            work->run();
        } catch (...) {
            work->failure = std::current_exception();
        }
        work = nullptr;  // what it owns ends here
        lock.lock();
        ++shared->done;
        shared->changed.notify_all();
    }
}

bool AttendedCalls::run_and_wait(std::shared_ptr<Work> work) {
    std::unique_lock lock(shared_->mutex);
    shared_->calls.push_back(std::move(work));
    const uint64_t own = ++shared_->posted, given_up = shared_->given_up;
    shared_->changed.notify_all();
    const auto is_over = [&] { return shared_->done >= own || shared_->given_up != given_up; };
    return shared_->changed.wait_for(lock, patience_, is_over) && shared_->done >= own;
}

void AttendedCalls::give_up() {
    const std::lock_guard lock(shared_->mutex);
    ++shared_->given_up;
    shared_->changed.notify_all();
}

}  // namespace ols
