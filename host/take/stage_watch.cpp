// SPDX-License-Identifier: MIT
// Lines and lamp nodes together.
#include "take/stage_watch.hpp"

#include <fmt/format.h>

namespace ols {

Result<StageWatch> StageWatch::open(const StageConfig& stage, StopRequest& stop) {
    StageWatch watch(stop);
    const auto on_stop = [&stop](const std::string& why) { stop.ask(why); };
    if (stage.gpio.has_lines()) {
        auto lines = StageLines::open(stage.gpio, on_stop);
        if (!lines.ok()) return lines.error();
        watch.lines_ = std::move(*lines);
    }
    if (!stage.telemetry.bus.empty()) {
        auto nodes = LampNodes::open(stage, on_stop);
        if (!nodes.ok()) return nodes.error();
        watch.nodes_ = std::move(*nodes);
    }
    watch.has_arm_ = stage.gpio.arm.has_value();
    return watch;
}

Status StageWatch::wait_for_arm(const std::function<Status()>& meanwhile) {
    return lines_->wait_for_arm(stop_->wanted, meanwhile);
}

// The lines last: their tally says that light is about to come.
Status StageWatch::begin_take() {
    if (nodes_)
        if (const Status ready = nodes_->begin_take(stop_->wanted); !ready.ok()) return ready;
    if (lines_) return lines_->begin_take(stop_->wanted);
    return Done{};
}

std::vector<std::string> StageWatch::end_take() {
    if (nodes_) nodes_->end_take();
    if (!lines_) return {};
    lines_->end_take();
    std::vector<std::string> notes = lines_->warnings();
    for (const LineReport& line : lines_->report())
        if (line.edges + line.edges_lost > 0)
            notes.push_back(fmt::format("line '{}' ({}): {} edges seen, {} known to be lost", line.line, line.use,
                                        line.edges, line.edges_lost));
    return notes;
}

nlohmann::json StageWatch::account() const {
    nlohmann::json json = nlohmann::json::object();
    if (lines_)
        for (const LineReport& line : lines_->report())
            json["gpio"].push_back({{"use", line.use},
                                    {"line", line.line},
                                    {"edges", line.edges},
                                    {"edges_lost", line.edges_lost},
                                    {"last_edge_monotonic_ns", line.last_edge_ns}});
    if (nodes_)
        for (const LampNodeReport& node : nodes_->report())
            json["lamp_nodes"].push_back({{"node", node.node},
                                          {"lamps", lamp_list(node.lamps)},
                                          {"frames", node.frames},
                                          {"frames_lost", node.frames_lost},
                                          {"temperature_c", {node.temperature_min_c, node.temperature_max_c}},
                                          {"current_ma", {node.current_min_ma, node.current_max_ma}},
                                          {"faults", node.faults},
                                          {"open_outputs", node.open_outputs}});
    return json;
}

}  // namespace ols
