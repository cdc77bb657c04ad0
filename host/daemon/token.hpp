// SPDX-License-Identifier: MIT
// The secret that a client of HTTP shows, kept in a file that only the daemon's user and group can read.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

// The token in a file, which is made with a new one (256 bits of the system's own randomness, in hexadecimal) where there is none.
// Errors: the file cannot be read or made, others may read it, what it holds is too short to be a secret.
Result<std::string> token_of_file(const std::string& path);

// In a time that depends on the length of `shown` alone.
bool is_token(const std::string& shown, const std::string& token);

}  // namespace ols
