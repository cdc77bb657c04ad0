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

// All its bytes. An error also if they are more than `most`.
Result<std::string> read_input(const std::string& path, uint64_t most);

}  // namespace ols
