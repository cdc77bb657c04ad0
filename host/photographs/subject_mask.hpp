// SPDX-License-Identifier: MIT
// A picture that says where the subject is.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "photographs/picture.hpp"
#include "result.hpp"

namespace ols {

struct SubjectMask {
    std::vector<uint32_t> bits;     // [y * width + x]: 0 inside, mask_outside outside (image/target.hpp)
    std::vector<std::string> said;  // how it was read, if not as usual; warnings
};

// Inside is: at least half of alpha, where the picture has an alpha that is not opaque everywhere; else non-zero, where its largest
// code is 1; else at least half of full scale in its brightest colour. Codes count as they are, whatever profile there is. Errors: what
// read_picture() refuses, another size than width x height.
Result<SubjectMask> read_subject_mask(const std::string& path, int width, int height, const PictureOptions& placing);

}  // namespace ols
