// SPDX-License-Identifier: MIT
// The log of events: lines on standard error, or the journal's fields where systemd gathers it.
#pragma once

#include "daemon/events.hpp"

namespace ols {

// What EventLog calls: "2026-05-01 12:00:00.123 info 302 take_began: ..."; in the journal with PRIORITY and OLS_CODE, OLS_EVENT, OLS_NUMBER,
// so that `journalctl OLS_EVENT=fault` finds them.
EventLog::Listener make_log();

}  // namespace ols
