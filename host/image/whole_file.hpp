// SPDX-License-Identifier: MIT
// Files that are there whole or not at all. What must survive a crash of the machine, too: archive/disk.hpp.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

// Calls `write` with a temporary name beside `path` and renames what it wrote: a reader sees the old file or the new one, never a
// part. If writing or renaming fails, the temporary file is removed, an older file stays, and the error says why.
Status write_whole_file(const std::string& path, const std::function<Status(const std::string& temporary)>& write);

// The same for bytes that are at hand.
Status write_whole_file(const std::string& path, std::string_view bytes);

}  // namespace ols
