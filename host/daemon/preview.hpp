// SPDX-License-Identifier: MIT
// The look at a take in between: a target of an archive, relit, as a picture.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

struct Preview {
    std::vector<uint8_t> png;
    int width = 0, height = 0;
    size_t masked_pixels = 0;  // of which the recording does not tell everything
};

// Lit by a key light from above the camera's left and a third of its light from
// everywhere: shape and shadow show, and nothing is black that was recorded. Tone curve: image/tone.hpp.
Result<Preview> preview_target(const std::string& archive, uint32_t camera, uint32_t index, double exposure_ev = 0);

}  // namespace ols
