// SPDX-License-Identifier: MIT
// The rows of a Radiance picture: flat or run-length encoded, old or new.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "result.hpp"

namespace ols {

using Rgbe = std::array<uint8_t, 4>;  // three mantissas and their exponent

// Takes `rows` rows of `length` pixels from the front of `bytes`. Memory is taken once the bytes can hold so many: new rows code 127
// pixels in 8 bytes, old ones 2^24 in 12 more; more than most_pixels are refused. Errors say what is wrong, without the file's name.
Result<std::vector<Rgbe>> read_radiance_rows(std::string_view& bytes, int rows, int length);

}  // namespace ols
