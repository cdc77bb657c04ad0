// SPDX-License-Identifier: MIT
// Numbered files: a recording as a folder of pictures, one a frame, or of samples without a header.
#pragma once

#include <memory>
#include <string>

#include "record/recorded_frames.hpp"

namespace ols {

struct NumberedOptions {
    std::string raw;        // "WIDTHxHEIGHT:LAYOUT" of files without a header; empty: pictures
    double full_scale = 0;  // the value that is the camera's largest count; 0: values are counts
    int bits = 12;          // of the camera's counts
};

// The layouts of `raw`, for --help: "12p, 12packed, ...".
std::string raw_layout_names();

// `path` is a folder whose files are of one series of numbers, one file of a series, or with `raw` one file that holds frame behind
// frame. A frame's number is the last one in its file's name, with a sign where the series has both. PNG, TIFF, PNM (8 and 16 bits, grey, or R G B of a
// camera without mosaic), OpenEXR (floats; whole numbers become counts) and DNG (the sensor's samples, with its black and white level)
// are read by what is in them, not by their names. Nothing is demosaiced, converted or turned. Errors name the file: another size or
// kind than the first, values that are no counts of the camera, lossy or turned pictures, two files of one number.
Result<Recording> open_numbered(const std::string& path, const NumberedOptions& options);

}  // namespace ols
