// SPDX-License-Identifier: MIT
// How deep a TOML text nests, found before it is parsed: parsers and the trees that they make recurse.
#pragma once

#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

constexpr int toml_brackets_max = 16;  // lists and tables in each other; our files have three
constexpr int toml_dots_max = 16;      // of one dotted key

// An error that names `path` and line where the text goes deeper. A text that is no TOML passes: that is for the parser to say.
Status check_toml_depth(const std::string& path, std::string_view text);

}  // namespace ols
