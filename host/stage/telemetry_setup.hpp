// SPDX-License-Identifier: MIT
// The lamp nodes' telemetry, as configured (`[telemetry]` of stage.toml).
#pragma once

#include <string>
#include <vector>

namespace ols {

class TomlSection;

// A lamp node is a driver of so many outputs (wire.h, ols_canbus_lamp_node).
constexpr int lamp_node_outputs = 16;

struct TelemetrySetup {
    std::string bus;               // "can:IFACE" or "can-socket:PATH"; "" none is watched
    std::vector<int> nodes;        // their numbers in the order of the chain: the k-th drives its bits from 16 k on
    double silent_s = 5;           // a node that says nothing for so long has failed; it speaks every second
    double temperature_max_c = 0;  // of the stage's own; 0: the nodes' own limit alone
};

// Without `nodes`, they are numbered along the chain of that many bits.
TelemetrySetup read_telemetry(TomlSection telemetry, int chain_bits);

}  // namespace ols
