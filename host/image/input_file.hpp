// SPDX-License-Identifier: MIT
// Files that a user names, opened to be read.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

// Opens a regular file, through links. Errors name it: not there, a folder, a pipe, a device, not to be read.
Result<std::ifstream> open_input(const std::string& path);

// In words what kind of file begins with these bytes (16 are enough): "a PNG picture", "empty".
std::string kind_of_bytes(std::string_view bytes);

// The bytes of a file. `what` names it in errors ("mesh"). Links are followed. Errors say what to do: an empty path, a path that
// leads nowhere, a folder, a device, a pipe or a socket (which are not waited for), more than `most_bytes` (said before memory
// is taken), a file that cannot be read.
Result<std::string> read_input(const std::string& path, const std::string& what, uint64_t most_bytes);

}  // namespace ols
