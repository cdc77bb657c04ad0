// SPDX-License-Identifier: MIT
// So many bytes, for people.
#pragma once

#include <string>

namespace ols {

// "12.3 GB", decimal units, three digits.
std::string bytes_text(double bytes);

}  // namespace ols
