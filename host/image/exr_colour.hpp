// SPDX-License-Identifier: MIT
// What an OpenEXR header says of the colours of its pixels.
#pragma once

#include <ImfHeader.h>

#include <string>

#include "image/primaries.hpp"
#include "result.hpp"

namespace ols {

struct StatedColour {
    Primaries primaries = rec709_primaries;
    bool known = true;  // false: the header names a space that is not linear, or not known here
    std::string said;   // about that; empty for nothing
};

// Rec. 709 where nothing is said. Errors, without the file's name: the header says data, or light that is not linear.
Result<StatedColour> stated_exr_colour(const Imf::Header& header);

}  // namespace ols
