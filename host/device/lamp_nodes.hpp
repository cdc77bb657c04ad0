// SPDX-License-Identifier: MIT
// The lamp nodes' telemetry on the CAN bus (protocol/PROTOCOL.md, "CAN"), watched during a take.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "device/can_bus.hpp"
#include "stage/stage.hpp"
#include "wire.h"

namespace ols {

// What a node said since the bus was opened.
struct LampNodeReport {
    int node = 0;
    std::vector<int> lamps;                // that it drives, sphere lamps first, then the matte board's
    uint64_t frames = 0, frames_lost = 0;  // lost: by the nodes' count, which is modulo 256
    double temperature_min_c = 0, temperature_max_c = 0;
    int current_min_ma = 0, current_max_ma = 0;
    uint8_t faults = 0;         // enum ols_lamp_fault bits, all that were ever set
    uint16_t open_outputs = 0;  // likewise
};

class LampNodes {
  public:
    // Called from a thread of its own, at most once, during a take.
    using OnStop = std::function<void(std::string why)>;

    // Of a stage with a telemetry bus.
    static Result<std::unique_ptr<LampNodes>> open(const StageConfig& stage, OnStop on_stop);

    LampNodes(std::unique_ptr<CanBus> bus, const StageConfig& stage, OnStop on_stop);
    ~LampNodes();

    // Waits until every node has been heard, a `silent_s` at most by the bus's clock. Errors: one is silent, or reports a fault; the
    // bus is down; `stop` has become true. From here on each of these stops the take.
    Status begin_take(const std::atomic<bool>& stop);
    void end_take();

    std::vector<LampNodeReport> report() const;

  private:
    struct Node {
        LampNodeReport report;
        uint64_t heard_us = 0;  // or since when it could have been
        int last_count = -1;
    };

    void watch();
    Status step();
    void take(int number, const ols_canbus_lamp_node& news);
    void look_for_silence();
    std::string fault_of(const Node& node, const ols_canbus_lamp_node& news) const;
    uint16_t open_with_lamp(const Node& node, uint16_t open_outputs) const;
    void note_trouble(const std::string& why);

    const TelemetrySetup setup_;
    const OnStop on_stop_;
    const std::unique_ptr<CanBus> bus_;
    std::vector<int> lamp_of_bit_;  // -1: none
    mutable std::mutex mutex_;      // all below
    std::map<int, Node> nodes_;     // by number
    std::map<int, int> first_bit_;  // of the chain, by node
    std::string trouble_;           // the first that stands against a take
    bool is_taking_ = false;
    std::atomic<bool> end_ = false;
    std::thread thread_;
};

// "48-63, 70"; "none".
std::string lamp_list(const std::vector<int>& lamps);

}  // namespace ols
