// SPDX-License-Identifier: MIT
// A recording by its path, whatever it is made of.
#pragma once

#include <optional>
#include <utility>

#include "recordings/numbered_files.hpp"
#include "stage/stage.hpp"

namespace ols {

struct RecordingOptions {
    NumberedOptions files;
    std::string range;  // "FIRST:LAST" by the recording's own numbers, either may be left out; empty: all
};

// A .cine, or numbered files. What it says of its size and colours has to be the camera's; the error names each key of [[camera]] that
// differs, with its value. Frames are at least 8 pixels a side.
Result<Recording> open_recording(const std::string& path, const RecordingOptions& options, const CameraConfig& camera);

}  // namespace ols
