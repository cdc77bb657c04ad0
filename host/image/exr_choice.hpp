// SPDX-License-Identifier: MIT
// Which part and channels of an OpenEXR file are the picture.
#pragma once

#include <ImfHeader.h>

#include <string>
#include <vector>

#include "image/exr.hpp"

namespace ols {

enum class ExrColour { grey, rgb, luminance_chroma };  // Y; R G B; Y RY BY

struct ExrLayer {
    int part = 0;
    std::string name;  // before the last dot of its channels; empty for most files
    ExrColour colour = ExrColour::rgb;
    std::vector<std::string> channels;  // as the file names them, in the order above, alpha last where there is one
    std::string left_out;               // in words what else the file holds; empty for nothing
};

// `headers` holds one of each part. One layer with colour is taken; among several, or with none of them, the one without a name; then
// one of luminance. Errors list what there is and say what to do, without the file's name.
Result<ExrLayer> choose_exr_layer(const std::vector<const Imf::Header*>& headers, const ExrChoice& choice);

}  // namespace ols
