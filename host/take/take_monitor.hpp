// SPDX-License-Identifier: MIT
// Take monitor: the live account of a running take, from the board's triggers to the archives' targets.
#pragma once

#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "record/record_monitor.hpp"

namespace ols {

// Of one archive, all cameras together.
struct OutputProgress {
    uint64_t targets_planned = 0;
    uint64_t targets_waiting = 0;    // whose frames are all decided, and that are not developed yet
    uint64_t targets_developed = 0;  // with what is waiting to be written
    uint64_t targets_written = 0, targets_missing = 0;
    std::string write_error;  // what could not be written first, and why; empty while all could
    // Of the recording, by the board's ticks: from the last slot that is developed to the last one that could be, in the camera
    // that is furthest behind. 0 when nothing waits.
    uint64_t ticks_behind = 0;
    double seconds_behind() const;
};

struct TakeProgress {
    RecordProgress record;  // with the stages of the whole pipeline
    std::vector<OutputProgress> outputs;
};

// One archive's. Thread-safe.
class OutputMonitor {
  public:
    OutputMonitor(StageBeats& stages, size_t output, size_t cameras, uint64_t period_ticks);

    OutputProgress progress() const;

    // For the take's threads. Triggers count from the take's first.
    void plan(uint64_t targets) {
        change([=](OutputProgress& p) { p.targets_planned += targets; });
    }
    void hand_on(size_t camera, uint64_t until_trigger);
    void develop(size_t camera, uint64_t until_trigger, bool has_target);
    void write() {
        change([](OutputProgress& p) { ++p.targets_written; });
    }
    void miss(uint64_t targets) {
        change([=](OutputProgress& p) { p.targets_missing += targets; });
    }

    void fail_to_write(const std::string& why) {
        change([&](OutputProgress& p) { p.write_error = why; });
    }

    StageBeat& developer_beat(size_t camera) { return *developers_[camera].beat; }
    StageBeat& writer_beat() { return writer_beat_; }

  private:
    struct Developer {
        StageBeat* beat = nullptr;
        uint64_t handed_on_until = 0, developed_until = 0;
    };

    template <typename Change>
    void change(Change&& change) {
        const std::lock_guard lock(mutex_);
        change(progress_);
    }

    const uint64_t period_ticks_;
    mutable std::mutex mutex_;
    OutputProgress progress_;
    std::vector<Developer> developers_;  // of the stage's cameras
    StageBeat& writer_beat_;
};

// Of one take; another one begins anew. Thread-safe.
class TakeMonitor {
  public:
    TakeProgress progress() const;

    RecordMonitor& record() { return record_; }
    // Stays where it is as long as this does.
    OutputMonitor& add_output(size_t cameras, uint64_t period_ticks);

  private:
    RecordMonitor record_;
    mutable std::mutex mutex_;  // of the outputs' number
    std::deque<OutputMonitor> outputs_;
};

}  // namespace ols
