// SPDX-License-Identifier: MIT
// What a recording came to, as JSON: the same in the report and in the manifest.
#pragma once

#include <nlohmann/json.hpp>

#include "record/recorder.hpp"

namespace ols {

// {"slots_total", "slots_missing", "causes", "board_end", "cameras": [{"name", "link", what became of its frames by count, "causes",
// "end"}]}. Of clocks, which no two takes have alike, nothing.
nlohmann::json record_json(const RecordReport& report);

}  // namespace ols
