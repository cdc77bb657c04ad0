// SPDX-License-Identifier: MIT
// Figures for Prometheus, in its text format 0.0.4, by its naming rules (prometheus.io/docs/practices/naming).
#pragma once

#include <string>

#include "daemon/conductor.hpp"

namespace ols {

std::string metrics_text(const Snapshot& now, const DaemonSetup& setup, const EventLog& events,
                         const std::string& program_version);

}  // namespace ols
