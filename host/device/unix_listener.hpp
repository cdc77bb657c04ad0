// SPDX-License-Identifier: MIT
// A Unix socket that others connect to.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

// A listening stream socket at `path`, which does not block and is the caller's to close and to unlink. Replaces a socket that
// nobody listens at any more. Only its owner may connect, and with `group_may` its group. Errors: it cannot be made there, or
// another program listens.
Result<int> listen_at(const std::string& path, bool group_may = false);

}  // namespace ols
