// SPDX-License-Identifier: MIT
// Cycle check: does the trigger log that the host has read say what the board's digest of the cycle says?
#pragma once

#include <span>

#include "result.hpp"
#include "wire.h"

namespace ols {

// `entries` are the log's, in order; those of other cycles are passed over. The error names the first difference: entries
// that are missing, a count, a time, or the CRC-32 of the whole.
Status check_cycle(const ols_cycle_digest& digest, std::span<const ols_trigger_log_entry> entries);

}  // namespace ols
