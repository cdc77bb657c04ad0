// SPDX-License-Identifier: MIT
// What became of a take, as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "take/take_choices.hpp"

namespace ols {

// The first archive's account with the recording's (record/record_json.hpp); those of the others in "also".
nlohmann::json take_json(const TakeReport& report, const std::vector<PlannedArchive>& planned);

}  // namespace ols
