// SPDX-License-Identifier: MIT
// Radiance pictures (.hdr, .pic), RGBE and XYZE.
#pragma once

#include <string>
#include <string_view>

#include "image/float_picture.hpp"
#include "result.hpp"

namespace ols {

// Reads a picture of 3 channels in its original units: what is stored over EXPOSURE and COLORCORR, all of them multiplied; any of
// the eight orders of pixels, turned upright; flat and run-length encoded rows, old and new. PRIMARIES are converted to Rec. 709;
// a file without is taken as Rec. 709. XYZE is candelas/m2 relative to equal-energy white, as ra_xyze(1) writes it, and becomes
// W/sr/m2 by Radiance's 179 lm/W. Mantissas are taken as they are, as most programs do (Radiance itself adds half a step).
// Source: Ward, "Radiance File Formats" (filefmts.pdf), "Picture File Format".
// Errors name the file and why: not there, no regular file, no Radiance picture, an unknown format, damaged, cut short, more
// pixels than the file can hold.
Result<FloatPicture> read_radiance(const std::string& path);

// Whether bytes begin as Radiance pictures do ("#?").
bool begins_as_radiance(std::string_view bytes);

}  // namespace ols
