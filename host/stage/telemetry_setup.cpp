// SPDX-License-Identifier: MIT
// Reading [telemetry] of stage.toml.
#include "stage/telemetry_setup.hpp"

#include <fmt/format.h>

#include <numeric>
#include <set>

#include "stage/toml_section.hpp"

namespace ols {

TelemetrySetup read_telemetry(TomlSection telemetry, int chain_bits) {
    TelemetrySetup setup;
    const int nodes_max = (chain_bits + lamp_node_outputs - 1) / lamp_node_outputs;
    telemetry.read("bus", setup.bus);
    if (!setup.bus.empty() && !setup.bus.starts_with("can:") && !setup.bus.starts_with("can-socket:"))
        telemetry.reject("bus", "is '" + setup.bus + "': write can:IFACE or can-socket:PATH");
    setup.nodes.resize(size_t(nodes_max));
    std::iota(setup.nodes.begin(), setup.nodes.end(), 0);
    telemetry.read("nodes", setup.nodes, 0, 255);
    telemetry.read("silent_s", setup.silent_s, 2, 600);
    telemetry.read("temperature_max_c", setup.temperature_max_c, 0, 200);
    if (std::set<int>(setup.nodes.begin(), setup.nodes.end()).size() != setup.nodes.size())
        telemetry.reject("nodes", "names a node twice");
    if (setup.nodes.empty()) telemetry.reject("nodes", "is empty: leave [telemetry] out where there are none");
    if (int(setup.nodes.size()) > nodes_max)
        telemetry.reject("nodes", fmt::format("lists {} nodes of {} outputs, and the chain's {} bits have {}",
                                              setup.nodes.size(), lamp_node_outputs, chain_bits, nodes_max));
    return setup;
}

}  // namespace ols
