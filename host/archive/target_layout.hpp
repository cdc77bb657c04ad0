// SPDX-License-Identifier: MIT
// What a target's file looks like, for those who write and those who read it: parts, channels, attributes.
#pragma once

#include <ImfFrameBuffer.h>
#include <ImfPixelType.h>

#include <string>
#include <vector>

#include "archive/archive.hpp"

namespace ols::target_layout {

inline constexpr int tile_size = 64;

inline constexpr const char* lamps_part = "lamps";
inline constexpr const char* mask_part = "mask";
inline constexpr const char* variance_part = "variance";
inline constexpr const char* noise_gain_part = "noise_gain";
inline constexpr const char* confidence_part = "confidence";
inline constexpr const char* matte_part = "matte";
inline constexpr const char* motion_part = "motion";

// Attributes of the lamps part.
inline constexpr const char* camera_attribute = "camera";  // which target this is, so that no other stands in for it
inline constexpr const char* index_attribute = "index";
inline constexpr const char* cfa_attribute = "cfa";
inline constexpr const char* basis_attribute = "basis";
inline constexpr const char* value_unit_attribute = "valueUnit";
inline constexpr const char* lights_attribute = "lights";
inline constexpr const char* color_attribute = "colorInteropID";
inline constexpr const char* missing_attribute = "missingLamps";
inline constexpr const char* provenance_attribute = "provenance";

// By Cfa.
inline constexpr const char* cfa_names[] = {"none", "rggb", "bggr", "grbg", "gbrg", "rgb"};

// The channels of all lamps in the order of Target::lamps: "lamp_000.Y", or .R .G .B.
std::vector<std::string> plane_channels(int lamps, Cfa cfa);

Imf::PixelType lamp_type(const TakeInfo& info);

// A line a lamp: layer and direction.
std::string lights_text(const TakeInfo& info);

// Samples of a box, row by row, the first at (box.x, box.y).
Imf::Slice slice_at(Imf::PixelType type, const void* first, const Box& box);

}  // namespace ols::target_layout
