// SPDX-License-Identifier: MIT
// A queue between threads: bounded, first in first out, closed by either end.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

namespace ols {

template <typename T>
class EventQueue {
  public:
    explicit EventQueue(size_t capacity) : capacity_(capacity) {}

    // Waits for room; a closed queue takes nothing more.
    void push(T value) {
        std::unique_lock lock(mutex_);
        has_room_.wait(lock, [&] { return values_.size() < capacity_ || closed_; });
        if (closed_) return;
        values_.push_back(std::move(value));
        has_value_.notify_one();
    }

    // Waits for a value; nothing once the queue is closed and empty.
    std::optional<T> pop() {
        std::unique_lock lock(mutex_);
        has_value_.wait(lock, [&] { return !values_.empty() || closed_; });
        if (values_.empty()) return std::nullopt;
        T value = std::move(values_.front());
        values_.pop_front();
        has_room_.notify_one();
        return value;
    }

    void close() {
        std::lock_guard lock(mutex_);
        closed_ = true;
        has_value_.notify_all();
        has_room_.notify_all();
    }

  private:
    const size_t capacity_;
    std::mutex mutex_;
    std::condition_variable has_room_, has_value_;
    std::deque<T> values_;
    bool closed_ = false;
};

}  // namespace ols
