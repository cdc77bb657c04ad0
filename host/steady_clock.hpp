// SPDX-License-Identifier: MIT
// This machine's steady clock (CLOCK_MONOTONIC), as one number.
#pragma once

#include <chrono>
#include <cstdint>

namespace ols {

inline uint64_t steady_ns() {
    return uint64_t(std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count());
}

}  // namespace ols
