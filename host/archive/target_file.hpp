// SPDX-License-Identifier: MIT
// A target as an OpenEXR file of its parts: lamps, mask, variance, noise gain, confidence, matte, motion.
#pragma once

#include <string>

#include "archive/archive.hpp"

namespace ols {

// "cam0/target_000000.exr", relative to the archive.
std::string target_file_name(uint32_t camera, uint32_t index);

// Writes and syncs `path` in blocks of whole tiles, so that no more than some 64 MB (or one tile of all planes) is held.
// On error the file is removed. `head.lamps` is not looked at.
Status write_target_file(const std::string& path, const TakeInfo& info, const Target& head, const PlaneSource& source);

// Size, colour filter, missing lamps, provenance and times of the motion, checked against the take. Camera and index are the caller's.
Result<Target> read_target_head(const std::string& path, const TakeInfo& info);

// The samples of a box; an empty box (width 0) means all. Errors name the file.
Result<Target> read_target_box(const std::string& path, const TakeInfo& info, Box box);

// Times and flows. Errors name the file; having no motion is one.
Result<TargetMotion> read_target_motion(const std::string& path, const TakeInfo& info);

}  // namespace ols
