// SPDX-License-Identifier: MIT
// What doctor found, for people and for scripts.
#pragma once

#include <nlohmann/json.hpp>

#include "doctor/finding.hpp"

namespace ols {

// A line a finding; below what is not well, what is needed and what to type. With colours where `is_coloured`.
std::string doctor_table(const Findings& findings, bool is_coloured);

nlohmann::json doctor_json(const Findings& findings);

}  // namespace ols
