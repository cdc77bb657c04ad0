// SPDX-License-Identifier: MIT
// Target writer: the thread that writes what developing made into the archive, and notes what it could not make.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <variant>

#include "record/event_queue.hpp"
#include "take/take_monitor.hpp"
#include "take/target_sink.hpp"

namespace ols {

// A target, or why there is none.
struct TargetOutcome {
    uint32_t camera = 0, index = 0;
    std::unique_ptr<Target> target;
    std::string why;
    nlohmann::json detail;
};

// Targets of which no frame came, for one reason.
struct LostTargets {
    uint32_t camera = 0, first = 0, last = 0;
    std::string why;
};

class TargetWriter {
  public:
    struct Report {
        int written = 0, missing = 0;
        double seconds = 0;
        std::string error;  // what could not be written first, and why
    };

    TargetWriter(TargetSink& sink, OutputMonitor& monitor)
        : sink_(sink), monitor_(monitor), thread_([this] { write(); }) {}
    ~TargetWriter() { (void)finish(); }

    // Each waits while the one before the last is written. Outcomes of one camera come in order.
    void take_place() { push(TakePlace{}); }
    void add(TargetOutcome outcome) { push(std::move(outcome)); }
    void add(LostTargets run) { push(std::move(run)); }

    // Whether somebody waits for what is being written.
    bool is_awaited() const { return waiting_ > 0; }

    // Waits until all is written.
    Report finish();

  private:
    struct TakePlace {};
    using Work = std::variant<TakePlace, TargetOutcome, LostTargets>;

    void push(Work work) {
        ++waiting_;
        work_.push(std::move(work));
        --waiting_;
    }
    void write();
    void count_missing(uint32_t targets);
    Status write(TakePlace) { return sink_.take_place(); }
    Status write(const TargetOutcome& outcome);
    Status write(const LostTargets& run);

    TargetSink& sink_;
    OutputMonitor& monitor_;
    Report report_;  // the thread's until it has ended
    EventQueue<Work> work_{1};
    std::atomic<int> waiting_ = 0;
    std::thread thread_;
};

}  // namespace ols
