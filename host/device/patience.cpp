// SPDX-License-Identifier: MIT
// Deadlines of exchanges.
#include "device/patience.hpp"

#include <fmt/format.h>

namespace ols {

Deadline Patience::begin_exchange() {
    return {Clock::now() + std::chrono::milliseconds(one_exchange_ms_), *this};
}

std::string Deadline::text() const {
    if (patience_.end_after_stop() < end_) return fmt::format("within {:.3g} s of the stop", Patience::stop_ms / 1e3);
    return fmt::format("within {:.3g} s", patience_.one_exchange_ms_ / 1e3);
}

}  // namespace ols
