// SPDX-License-Identifier: MIT
// The kernel's answer about a network interface, taken apart.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "doctor/machine.hpp"

namespace ols {

// Of a message RTM_NEWLINK, of whatever bytes; nothing when it is none.
std::optional<LinkDetails> link_details_in(std::span<const std::byte> message);

}  // namespace ols
