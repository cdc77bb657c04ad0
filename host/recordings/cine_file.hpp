// SPDX-License-Identifier: MIT
// Phantom .cine files, read in place.
//
// Source: Vision Research, "Cine File Format" (July 2017): chapter "Fixed structures" (CINEFILEHEADER, BITMAPINFOHEADER, SETUP),
// "Tagged information blocks", "Images" (annotations, packed 10 and 12 bits). What libavformat's demuxer leaves out is read here:
// the times of the frames (block 1002), black and white level, the camera's frame numbers, packed samples, height of either sign;
// the tests hold the samples of what it does read against it.
#pragma once

#include <memory>
#include <string>

#include "record/recorded_frames.hpp"

namespace ols {

// Samples are counts as the camera stores them, rows top to bottom as on the sensor; 10 bits packed are linearised to 12 by the format's table. Of
// the file only headers, times and offsets are kept in memory (24 bytes a frame). Errors name the file and what is wrong with it: no
// .cine, cut short, an offset or size that lies outside of it, a kind that is not read (JPEG, several heads).
Result<Recording> open_cine(const std::string& path);

bool is_cine(const std::string& path);  // by its first bytes

}  // namespace ols
