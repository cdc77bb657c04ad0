// SPDX-License-Identifier: MIT
// A running take's figures, as `status` and the event take_progress have them.
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/conductor.hpp"

namespace ols {

nlohmann::json progress_json(const RunningTake& take);

}  // namespace ols
