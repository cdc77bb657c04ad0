// SPDX-License-Identifier: MIT
// Decimal units.
#include "image/bytes_text.hpp"

#include <fmt/format.h>

#include <iterator>

namespace ols {

std::string bytes_text(double bytes) {
    constexpr const char* units[] = {"bytes", "kB", "MB", "GB", "TB"};
    size_t unit = 0;
    while (bytes >= 999.5 && unit + 1 < std::size(units)) {
        bytes /= 1000;
        ++unit;
    }
    return unit == 0 || bytes >= 99.95 ? fmt::format("{:.0f} {}", bytes, units[unit])
                                       : fmt::format("{:.3g} {}", bytes, units[unit]);
}

}  // namespace ols
