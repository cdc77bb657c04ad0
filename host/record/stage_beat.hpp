// SPDX-License-Identifier: MIT
// Beats of the pipeline's stages: what a watchdog reads to tell a stage that works from one that hangs.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

namespace ols {

// What the thread of a stage is doing. Of the four only `works` must come to an end: the others end when a neighbour's work does.
enum class StageActivity {
    works,
    waits_for_input,
    waits_for_room,  // what it made, or is to take, has no place yet
    ended,
};

struct StageProgress {
    std::string name;  // "camera 0 reader"
    uint64_t beats = 0;
    StageActivity activity = StageActivity::works;
};

// One thread beats, any reads.
class StageBeat {
  public:
    explicit StageBeat(std::string name) : name_(std::move(name)) {}

    void beat(StageActivity now = StageActivity::works) {
        activity_.store(now, std::memory_order_relaxed);
        beats_.fetch_add(1, std::memory_order_relaxed);
    }
    StageProgress progress() const {
        return {name_, beats_.load(std::memory_order_relaxed), activity_.load(std::memory_order_relaxed)};
    }

  private:
    const std::string name_;
    std::atomic<uint64_t> beats_ = 0;
    std::atomic<StageActivity> activity_ = StageActivity::waits_for_input;
};

// All of a take, in the order in which they were added. Thread-safe.
class StageBeats {
  public:
    // Stays where it is as long as this does.
    StageBeat& add(std::string name) {
        const std::lock_guard lock(mutex_);
        return beats_.emplace_back(std::move(name));
    }
    std::vector<StageProgress> progress() const {
        const std::lock_guard lock(mutex_);
        std::vector<StageProgress> all;
        for (const StageBeat& beat : beats_) all.push_back(beat.progress());
        return all;
    }

  private:
    mutable std::mutex mutex_;
    std::deque<StageBeat> beats_;
};

}  // namespace ols
