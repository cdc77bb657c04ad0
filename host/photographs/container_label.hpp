// SPDX-License-Identifier: MIT
// What HEIF and WebP files say of their colours and their orientation, which OpenImageIO 2.4 does not hand on.
#pragma once

#include <string>
#include <vector>

#include "photographs/color_label.hpp"
#include "result.hpp"

namespace ols {

struct ContainerLabel {
    ColorLabel label;
    std::vector<uint8_t> exif;  // TIFF header first; empty: none
    std::vector<std::string> said;
};

// The colour box of the primary picture of a HEIC or AVIF file: an ICC profile, or codes of ITU-T H.273 (`nclx`). Turning and cropping are
// properties of such files and libheif's to apply; their Exif orientation says nothing (ISO/IEC 23008-12, A.2.2). Errors: damaged, coded
// for a display (PQ, HLG).
Result<ContainerLabel> read_heif_label(const std::string& path);

// ICCP and EXIF chunks of a WebP file (RFC 9649, 2.7.1). Errors: damaged.
Result<ContainerLabel> read_webp_label(const std::string& path);

// Colour codes of ITU-T H.273 as a label. Errors (without the file's name): a transfer for displays, primaries of another kind.
Result<ColorLabel> label_of_codes(int primaries, int transfer, const std::string& name);

}  // namespace ols
