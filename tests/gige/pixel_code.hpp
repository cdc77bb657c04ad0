// SPDX-License-Identifier: MIT
// Pixel formats by their names and codes, and packing samples in them: PFNC 2.4 and its list of values.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace ols::test {

struct PixelCode {
    const char* name;
    uint32_t code;  // bits 16 to 23: bits that a pixel takes
    int bits;       // of a sample
    enum Packing { unpacked, stream, pairs } packing;
};
const std::vector<PixelCode>& pixel_codes();
const PixelCode& pixel_code(const std::string& name);
const PixelCode& pixel_code(uint32_t code);

// Samples as such a camera sends them, with no gap between rows.
std::vector<uint8_t> packed(const std::vector<uint16_t>& samples, const PixelCode& format);

}  // namespace ols::test
