// SPDX-License-Identifier: MIT
// What a picture file says of its size and pages, looked at before memory is taken.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

// At most 65535 pixels a side, 2^28 pixels in all, and samples of no more bytes than 64 MB or 2000 times the file's, whichever is more
// (flat pictures pack tightly). Errors name the file.
Status check_stated_size(const std::string& path, double width, double height, double bytes_a_pixel);

// The second of these bounds alone, of any memory that a file asks for.
bool can_hold(const std::string& path, double bytes);

// Page `page` (from 1; 0: the only one) of a file of `pages`. Errors: several and no choice, none of this number.
Status check_page(const std::string& path, int pages, int page);

}  // namespace ols
