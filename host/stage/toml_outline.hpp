// SPDX-License-Identifier: MIT
// What of a TOML text is looked at before it is parsed: how deep it nests, for parsers and the trees that they make recurse, and what
// toml++ 3.3 does not bear, which asserts that a name follows a bracket and knows not every letter beyond ASCII.
#pragma once

#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

constexpr int toml_brackets_max = 16;  // lists and tables in each other; our files have three
constexpr int toml_dots_max = 16;      // of one dotted key

// An error that names `path` and line where the text goes deeper, names no table behind the bracket that begins a line, or has
// letters beyond ASCII outside of texts and comments. Other texts that are no TOML pass: that is for the parser to say.
Status check_toml_outline(const std::string& path, std::string_view text);

}  // namespace ols
