// SPDX-License-Identifier: MIT
// A picture file's samples as they are coded, through OpenImageIO, and what the file says of them.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "photographs/color_label.hpp"
#include "photographs/picture_format.hpp"
#include "result.hpp"

namespace ols {

// Of the camera; 0 where the file does not say.
struct ExposureSettings {
    double seconds = 0, f_number = 0, iso = 0;
};

struct PictureSamples {
    int width = 0, height = 0;
    int channels = 0;            // interleaved: grey or R G B, then alpha or another one
    int colors = 0;              // 1 or 3
    int alpha = -1;              // its channel
    bool is_multiplied = false;  // by alpha, in the file
    // Codes of 8 or 16 bits; else fractions of the largest code of an integer type (signed ones from -1), or floats as they are.
    std::variant<std::vector<uint8_t>, std::vector<uint16_t>, std::vector<float>> codes;
    bool is_integer = true;
    double last_code = 0;  // the largest of the file's own bits (4095 for 12); 0 for floats
    int orientation = 1;   // Exif, 1 to 8
    ColorLabel label;
    ExposureSettings exposure;
    std::vector<std::string> said;
};

// Notes that alpha, or another channel beside the colours, is not used.
void say_other_channel(PictureSamples& samples);

// Reads page `page` (from 1; 0: the only one) of a file of a format but OpenEXR, Radiance and raw. Memory is taken once the stated
// size was found possible (stated_size.hpp). Errors name the file: damaged, several pages, CMYK or Lab colours, channels that are no
// colours.
Result<PictureSamples> read_samples(const std::string& path, PictureFormat format, int page);

}  // namespace ols
