// SPDX-License-Identifier: MIT
// Bytes as text, and back (RFC 4648, section 4).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "result.hpp"

namespace ols {

std::string base64_of(std::span<const uint8_t> bytes);

// Error: it is not what base64_of() makes: letters, padding, length.
Result<std::string> bytes_of_base64(std::string_view text);

}  // namespace ols
