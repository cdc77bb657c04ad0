// SPDX-License-Identifier: MIT
// Files that are read whole: regular ones of a bounded size, and nothing else.
#pragma once

#include <cstdint>
#include <string>

#include "result.hpp"

namespace ols {

// The bytes of a file. `what` names it in errors ("mesh"). Links are followed. Errors say what to do: an empty path, a path that
// leads nowhere, a folder, a device, a pipe or a socket (which are not waited for), more than `most_bytes` (said before memory
// is taken), a file that cannot be read.
Result<std::string> read_bounded_file(const std::string& path, const std::string& what, uint64_t most_bytes);

}  // namespace ols
