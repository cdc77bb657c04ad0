// SPDX-License-Identifier: MIT
// What watches a stage while it plays: its GPIO lines and its lamp nodes, as the stage configures them.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "device/lamp_nodes.hpp"
#include "device/stage_lines.hpp"
#include "record/stop_request.hpp"

namespace ols {

class StageWatch {
  public:
    // Opens what the stage has; a stage without lines and telemetry has a watch that does nothing. `stop` outlives it.
    static Result<StageWatch> open(const StageConfig& stage, StopRequest& stop);

    bool has_arm_button() const { return has_arm_; }
    // Until the button is pressed, or a stop is asked for. `meanwhile` is called some fifty times a second, and its error ends the
    // wait: an armed board goes dark with a fault when it hears nothing for its heartbeat.
    Status wait_for_arm(const std::function<Status()>& meanwhile = nullptr);

    // From here on trouble asks for a stop with its reason, and the tally is lit. Errors say what stands against it.
    Status begin_take();
    // Dark again. What there is to say of the lines: warnings, and what became of edges.
    std::vector<std::string> end_take();

    // {"gpio": [...], "lamp_nodes": [...]} of what there is, for report and manifest.
    nlohmann::json account() const;

  private:
    explicit StageWatch(StopRequest& stop) : stop_(&stop) {}

    StopRequest* stop_;
    bool has_arm_ = false;
    std::unique_ptr<StageLines> lines_;
    std::unique_ptr<LampNodes> nodes_;
};

}  // namespace ols
