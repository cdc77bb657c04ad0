// SPDX-License-Identifier: MIT
// Damage that decoders pass over with a warning, or without, found by the library that knows the format best; and what a file says
// of its colours that OpenImageIO does not hand on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "photographs/color_label.hpp"
#include "result.hpp"

namespace ols {

inline constexpr uint64_t largest_picture_file = uint64_t(1) << 32;

inline Error damaged_picture(const std::string& path, const std::string& why) {
    return fail("'" + path + "' is damaged (" + why + "): copy it again");
}

// Decodes a JPEG file's entropy-coded data and makes an error of every warning of libjpeg's: a code that is none, data cut short, bytes
// left over before a marker. CMYK is refused. A changed bit that gives another valid code leaves no trace in this format.
Status check_jpeg(const std::string& path);

// Reads all chunks of a PNG file (W3C PNG, 3rd edition), checks their CRCs and that the file has its end, and returns what
// cICP, iCCP, sRGB, gAMA and cHRM say (11.3.2). Errors: damaged, or coded for a display (PQ, HLG) or in Y'CbCr.
Result<ColorLabel> read_png_label(const std::string& path);

inline constexpr int photometric_palette = 3;                                  // TIFF 6.0
inline constexpr int photometric_cfa = 32803, photometric_linear_raw = 34892;  // TIFF/EP, DNG

struct TiffPage {
    int photometric = 1;  // TIFF 6.0 section 8
    int width = 0, height = 0;
    int bits = 1, samples = 1;
    ColorLabel label;  // TransferFunction, PrimaryChromaticities (section 20)
};

// The tags of all pages of a TIFF file. Errors: damaged, or a preview whose sub-directory holds the picture (a raw that LibRaw does not know).
Result<std::vector<TiffPage>> read_tiff_pages(const std::string& path);

// Reads all samples of page `page` (from 0) through libtiff, whose errors and warnings while decoding are errors here.
Status check_tiff_page(const std::string& path, int page);

// The samples of a page of 1 bit a pixel, as 0 and 1 [y * width + x]. OpenImageIO takes a file that leaves BitsPerSample out, which then is 1
// (TIFF 6.0, section 3), for one of 8 bits.
Result<std::vector<uint8_t>> read_bilevel(const std::string& path, int page);

struct DngCrop {
    double x, y, width, height;
};

// DefaultCropOrigin and DefaultCropSize (DNG 1.4) of the raw picture of a DNG file; nothing if it has none.
std::optional<DngCrop> dng_default_crop(const std::string& path);

}  // namespace ols
