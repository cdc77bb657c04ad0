// SPDX-License-Identifier: MIT
// What a picture file says of its size and pages, looked at before memory is taken.
#pragma once

#include <string>

#include "result.hpp"

namespace ols {

// At most 65535 pixels a side, 2^28 pixels in all, and no more bytes of samples than 2000 times the file's, which no format but HEIC and
// AVIF packs tighter; with `packs_flat` (these) 64 MB are possible at any size. Errors name the file.
Status check_stated_size(const std::string& path, double width, double height, double bytes_a_pixel,
                         bool packs_flat = false);

// Page `page` (from 1; 0: the only one) of a file of `pages`. Errors: several and no choice, none of this number.
Status check_page(const std::string& path, int pages, int page);

}  // namespace ols
