// SPDX-License-Identifier: MIT
// Numbers as mesh and target files write them, whatever the locale.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace ols {

// The words between blanks and tabs.
std::vector<std::string_view> words_of(std::string_view line);

// A decimal number, perhaps with a plus sign; one too small for a double is 0. Nothing if it is none, infinite or no number.
std::optional<double> decimal_number(std::string_view word);

// A whole number, perhaps with a sign.
std::optional<int64_t> whole_number(std::string_view word);

}  // namespace ols
