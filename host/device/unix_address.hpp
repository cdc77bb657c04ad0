// SPDX-License-Identifier: MIT
// The address of a Unix socket.
#pragma once

#include <sys/un.h>

#include <string>

#include "result.hpp"

namespace ols {

// Of a socket at `path`. Error: the system has no room for it, or it is empty.
Result<sockaddr_un> unix_address(const std::string& path);

}  // namespace ols
