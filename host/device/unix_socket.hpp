// SPDX-License-Identifier: MIT
// Unix sockets of the emulated board: connecting, and whole records.
#pragma once

#include <cstddef>
#include <string>

#include "result.hpp"

namespace ols {

// A connected stream socket. `what` listens at `path`; the error names both and says to start the stage first.
Result<int> connect_unix(const std::string& path, const std::string& what);

// Receives all `count` bytes; false when the other end has gone.
bool receive_whole(int fd, void* bytes, size_t count);

// Sends all `count` bytes; false when the other end has gone.
bool send_whole(int fd, const void* bytes, size_t count);

}  // namespace ols
