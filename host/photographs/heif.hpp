// SPDX-License-Identifier: MIT
// HEIC and AVIF files through libheif. OpenImageIO 2.4 reads them beyond their end if they are damaged, and 10 bits as 8.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "photographs/picture_samples.hpp"
#include "result.hpp"

namespace ols {

struct HeifPicture {
    PictureSamples samples;     // R G B, with alpha where the file has it; without exposure settings
    std::vector<uint8_t> exif;  // TIFF header first; empty: none
};

// Reads page `page` (from 1; 0: the only one) at its own bits (8 to 16), turned, mirrored and cropped as its properties say; its label is an ICC
// profile or codes of ITU-T H.273 (`nclx`). Errors name the file: damaged (warnings of libheif, too), several pages, coded for a display
// (PQ, HLG), a size that its bytes cannot hold.
Result<HeifPicture> read_heif(const std::string& path, int page);

}  // namespace ols
