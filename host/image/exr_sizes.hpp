// SPDX-License-Identifier: MIT
// What an OpenEXR file says about its sizes, held against its own length before the library takes memory for it.
#pragma once

#include <cstdint>
#include <istream>

#include "result.hpp"

namespace ols {

// Beyond the data window, a display window may add this many black pixels (an 8k map), or 16 times the data window's.
inline constexpr uint64_t most_black_pixels = uint64_t(1) << 25;

// A chunk of lines as the library decodes it may be this large in any file.
inline constexpr uint64_t most_chunk_bytes = uint64_t(1) << 27;

// Walks the headers (OpenEXR file layout, openexr.com/en/latest/OpenEXRFileLayout.html) and checks of every part: attributes lie in
// the file; the table of chunks can; the pixels of the data window, and of one tile, are no more than its compression could have
// made of the file's bytes, and no more than most_pixels; so is the display window's share. Errors say what is wrong, without the
// file's name. Whatever else there is in a header is the library's to check.
Status check_exr_sizes(std::istream& file, uint64_t file_bytes);

}  // namespace ols
