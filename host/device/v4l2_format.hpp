// SPDX-License-Identifier: MIT
// Pixel formats of V4L2 that carry our frames, and which of them a device offers.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "device/v4l2_device.hpp"
#include "image/sample_layout.hpp"

namespace ols {

// How a format lays out its samples; nothing for one that is not ours to read.
std::optional<SampleLayout> layout_of_fourcc(uint32_t fourcc);

struct OfferedFormat {
    uint32_t fourcc;
    std::string description;  // the driver's
};
// VIDIOC_ENUM_FMT (vidioc-enum-fmt.rst).
std::vector<OfferedFormat> offered_formats(V4l2Device& device);

// Of the formats with this mosaic and so many bits the one that takes the fewest bytes; nothing when none is offered.
std::optional<uint32_t> choose_format(const std::vector<OfferedFormat>& offered, Cfa cfa, int bits);

// One to compare with where none is: of this mosaic, or else any that is read here, or else any.
uint32_t nearest_format(const std::vector<OfferedFormat>& offered, Cfa cfa);

// "GREY (8-bit Greyscale), RG12 (12-bit Bayer RGRG/GBGB); not read here: MJPG"
std::string describe_formats(const std::vector<OfferedFormat>& offered);

}  // namespace ols
