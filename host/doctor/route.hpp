// SPDX-License-Identifier: MIT
// Over which of the machine's network interfaces an address is reached.
#pragma once

#include <optional>
#include <string>

#include "doctor/machine.hpp"

namespace ols {

struct Route {
    std::string interface;
    bool is_direct = false;  // the address is in a network of the interface's own, behind no router
};

// Nothing when no route leads there. `address` is IPv4, "192.168.0.2".
std::optional<Route> route_to(const Machine& machine, const std::string& address);

}  // namespace ols
