// SPDX-License-Identifier: MIT
// The part "motion" of a target's file: the flow to each instant around the target, as half floats, their times in the header.
#pragma once

#include <ImfHeader.h>
#include <ImfPixelType.h>
#include <ImfTiledInputPart.h>
#include <ImfTiledOutputPart.h>

#include <map>
#include <string>
#include <vector>

#include "image/target_motion.hpp"
#include "result.hpp"

namespace ols {

// Adds the layers instant_000.u, instant_000.v ... and their times to the header of the part.
void add_motion_layers(Imf::Header& header, const std::vector<double>& times_s);

// The channels of a part of so many instants.
std::map<std::string, Imf::PixelType> motion_channels(size_t instants);

// The times that add_motion_layers() put there, one or more. An error, which follows the name of the part, where they are damaged.
Result<std::vector<double>> motion_times(const Imf::Header& header);

// Whether half floats, which end at 65504, hold the motion.
Status check_motion_range(const TargetMotion& motion);

// Both throw what OpenEXR throws. Flows are rounded to halves when written: an error of at most 1/2048 of a vector's component.
void write_motion_tiles(Imf::TiledOutputPart part, const TargetMotion& motion);
std::vector<FlowField> read_motion_tiles(Imf::TiledInputPart part, size_t instants);

}  // namespace ols
