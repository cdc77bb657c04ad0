// SPDX-License-Identifier: MIT
// stagectl status of the daemon's stage.
#pragma once

#include "stagectl/daemon_options.hpp"

namespace ols {

struct DaemonStatusOptions {
    bool clear_fault = false, watch = false, metrics = false, json = false;
};

// Exit code 1 where the stage is in a fault.
Result<int> daemon_status(const DaemonLink& link, const DaemonStatusOptions& options);

}  // namespace ols
