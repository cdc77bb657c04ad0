// SPDX-License-Identifier: MIT
// Writing a target as an OpenEXR file of its parts: lamps, mask, variance, noise gain, confidence, matte, motion.
#pragma once

#include <string>

#include "archive/archive.hpp"

namespace ols {

// "cam0/target_000000.exr", relative to the archive.
std::string target_file_name(uint32_t camera, uint32_t index);

// Writes and syncs `path` in blocks of whole tiles, so that no more than some 64 MB (or one tile of all planes) is held.
// Sizes, lamps, times and attributes that a reader would refuse are errors. On error the file is removed. `head.lamps` is not looked at.
Status write_target_file(const std::string& path, const TakeInfo& info, const Target& head, const PlaneSource& source);

}  // namespace ols
