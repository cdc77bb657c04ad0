// SPDX-License-Identifier: MIT
// ReadAhead: values that take long to make, made by several threads a little ahead of who takes them, and taken in order.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace ols {

template <typename Value>
class ReadAhead {
  public:
    // make(i) for i < count, from any thread; must not throw. At most `2 * threads` values wait.
    ReadAhead(uint64_t count, int threads, std::function<Value(uint64_t)> make)
        : count_(count), ahead_(2 * uint64_t(threads)), make_(std::move(make)) {
        try {
            for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
        } catch (const std::system_error&) {  // take() makes what no thread does
        }
    }
    ~ReadAhead() {
        {
            const std::scoped_lock lock(mutex_);
            ended_ = true;
        }
        changed_.notify_all();
    }
    ReadAhead(const ReadAhead&) = delete;

    // The next value; call it `count` times at most.
    Value take() {
        std::unique_lock lock(mutex_);
        if (taken_ == claimed_) make_one(lock);
        changed_.wait(lock, [&] { return made_.contains(taken_); });
        auto node = made_.extract(taken_++);
        changed_.notify_all();
        return std::move(node.mapped());
    }

  private:
    void work() {
        std::unique_lock lock(mutex_);
        while (true) {
            changed_.wait(lock, [&] { return ended_ || claimed_ == count_ || claimed_ < taken_ + ahead_; });
            if (ended_ || claimed_ == count_) return;
            make_one(lock);
        }
    }
    void make_one(std::unique_lock<std::mutex>& lock) {
        const uint64_t index = claimed_++;
        lock.unlock();
        Value value = make_(index);
        lock.lock();
        made_.emplace(index, std::move(value));
        changed_.notify_all();
    }

    const uint64_t count_, ahead_;
    const std::function<Value(uint64_t)> make_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<uint64_t, Value> made_;
    uint64_t claimed_ = 0, taken_ = 0;
    bool ended_ = false;
    std::vector<std::jthread> threads_;  // last, so that they end first
};

}  // namespace ols
