// SPDX-License-Identifier: MIT
// Lines and lamp nodes together.
#include "stagectl/stage_watch.hpp"

#include <cstdio>

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

Status StageWatch::wait_for_arm() {
    std::fprintf(stderr, "stagectl: waiting for the arm button\n");
    return lines_->wait_for_arm(stop_->wanted);
}

// The lines last: their tally says that light is about to come.
Status StageWatch::begin_take() {
    if (nodes_)
        if (const Status ready = nodes_->begin_take(stop_->wanted); !ready.ok()) return ready;
    if (lines_) return lines_->begin_take(stop_->wanted);
    return Done{};
}

void StageWatch::end_take() {
    if (nodes_) nodes_->end_take();
    if (!lines_) return;
    lines_->end_take();
    for (const std::string& warning : lines_->warnings()) std::fprintf(stderr, "stagectl: %s\n", warning.c_str());
    for (const LineReport& line : lines_->report())
        if (line.edges + line.edges_lost > 0)
            std::fprintf(stderr, "stagectl: line '%s' (%s): %llu edges seen, %llu known to be lost\n",
                         line.line.c_str(), line.use.c_str(), static_cast<unsigned long long>(line.edges),
                         static_cast<unsigned long long>(line.edges_lost));
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
