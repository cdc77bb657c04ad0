// SPDX-License-Identifier: MIT
// The stage's own lines during a take: the arm button begins it, emergency stop and lost genlock end it, the tally light shows it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "device/gpio.hpp"

namespace ols {

// A level counts once it has held for so long; time comes from the edges, not from when they were read.
class DebouncedLevel {
  public:
    DebouncedLevel(bool active, uint64_t hold_ns) : hold_ns_(hold_ns), level_(active), candidate_(active) {}

    // The level from `time_ns` on. True when it has become another by then.
    bool set(bool active, uint64_t time_ns);
    bool advance(uint64_t now_ns);

    bool active() const { return level_; }
    bool is_settled() const { return candidate_ == level_; }

  private:
    uint64_t hold_ns_, since_ns_ = 0;
    bool level_, candidate_;
};

// What became of one line's edges; for the report and the manifest.
struct LineReport {
    std::string use, line;  // "emergency_stop", "ESTOP"
    uint64_t edges = 0, edges_lost = 0;
    uint64_t last_edge_ns = 0;  // CLOCK_MONOTONIC; 0: none came
};

class StageLines {
  public:
    // Called from a thread of its own, at most once, during a take.
    using OnStop = std::function<void(std::string why)>;

    static Result<std::unique_ptr<StageLines>> open(const GpioSetup& setup, OnStop on_stop);

    // With lines that are open, inputs_of() and outputs_of() in this order.
    StageLines(std::unique_ptr<GpioLines> lines, const GpioSetup& setup, OnStop on_stop);
    ~StageLines();  // the tally is dark

    static std::vector<GpioLineSetup> inputs_of(const GpioSetup& setup);
    static std::vector<GpioLineSetup> outputs_of(const GpioSetup& setup);

    // Returns when the arm button has been pressed; one that is down already must be let go first. Errors: `stop` has become true,
    // the emergency stop is or was pressed, the chip has gone; what `meanwhile` says, which is called some fifty times a second.
    Status wait_for_arm(const std::atomic<bool>& stop, const std::function<Status()>& meanwhile = nullptr);

    // A take begins: the tally is lit, until the take ends or `stop` is true. Errors: the emergency stop is or was pressed, genlock is
    // absent where that stops, the chip has gone.
    Status begin_take(const std::atomic<bool>& stop);
    void end_take();

    std::vector<LineReport> report() const;
    std::vector<std::string> warnings() const;  // of what did not stop a take, and should be known

  private:
    enum Use { arm, emergency_stop, genlock };
    struct Input {
        Use use;
        GpioLineSetup setup;
        EdgeAccount account;
        DebouncedLevel level;
        uint64_t last_edge_ns = 0;
    };

    void add_input(Use use, const std::optional<GpioLineSetup>& setup);
    void watch();
    void take_edge(const GpioEdge& edge);
    void look(const std::vector<bool>& levels, uint64_t now_ns);
    void follow_level(Input& input, bool has_changed);
    void note_trouble(const std::string& why);
    std::string genlock_absent() const;
    Status set_tally(bool lit);
    std::string describe(const Input& input) const;

    const GpioSetup setup_;
    const OnStop on_stop_;
    const std::unique_ptr<GpioLines> lines_;
    mutable std::mutex mutex_;  // all below
    std::condition_variable changed_;
    std::vector<Input> inputs_;
    std::string trouble_;  // the first that stands against a take
    std::vector<std::string> warnings_;
    uint64_t presses_ = 0;
    bool is_taking_ = false, is_lit_ = false, end_ = false;
    const std::atomic<bool>* stop_ = nullptr;  // during a take
    std::thread thread_;
};

}  // namespace ols
