// SPDX-License-Identifier: MIT
// The part "matte" of a target's file: its samples and their variance, as floats, the number of its frames in the header.
#pragma once

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfPixelType.h>
#include <ImfTiledOutputPart.h>

#include <map>
#include <string>

#include "image/target_matte.hpp"
#include "result.hpp"

namespace ols {

// An error where planes or variance are not of the target's size and number, or hold Inf or NaN.
Status check_matte(const TargetMatte& matte, int planes, size_t pixels);

// Adds the channels Y, or R, G and B, and variance where it is known.
void add_matte_channels(Imf::Header& header, const TargetMatte& matte);

// Throws what OpenEXR throws.
void write_matte_tiles(Imf::TiledOutputPart part, const TargetMatte& matte);

// The channels of a part of so many planes.
std::map<std::string, Imf::PixelType> matte_channels(int planes, bool has_variance);
bool has_matte_variance(const Imf::Header& header);

// What the header says: the number of frames, and empty planes, as many as there are. An error, which follows the name of the part,
// where it is damaged.
Result<TargetMatte> matte_head(const Imf::Header& header, int planes);

// Makes room for `width` x height pixels and gives the slices to read them with, the first at (x, y).
Imf::FrameBuffer matte_buffer(TargetMatte& matte, const Imf::Header& header, int x, int y, int width, int height);

}  // namespace ols
