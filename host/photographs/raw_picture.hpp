// SPDX-License-Identifier: MIT
// Camera RAW through LibRaw: the sensor's own samples, or linear R G B.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

enum class RawUse {
    refuse,
    mosaic,  // the sensor's samples, not demosaiced, not white-balanced
    rgb,     // demosaiced, white balance of daylight by the camera's own matrix: the same for all pictures of a camera
};

// The camera's black level is 0 and its white level 1; nothing depends on what a picture shows. `light` lies as the sensor does.
struct RawPicture {
    Image light;
    Cfa cfa = Cfa::none;     // of a mosaic
    int orientation = 1;     // as the file says
    bool is_rec709 = false;  // R G B by the camera's matrix
    std::vector<std::string> said;
};

// The sensor's samples as they are, and the levels that the file states.
struct RawCounts {
    int width = 0, height = 0;
    std::vector<uint16_t> counts;  // row by row
    Cfa cfa = Cfa::none;           // none of a sensor without filters
    double black = 0, white = 0;   // counts; black the mean of the four places of a mosaic
    bool has_one_black = true;     // all four are the same
};

// Whether LibRaw knows the file as a camera's raw.
bool is_camera_raw(const std::string& path);

// The default crop of a DNG file (DNG 1.4, DefaultCropOrigin and DefaultCropSize) is taken, of others the active area. Errors name
// the file: damaged, no Bayer mosaic where one is asked for, too large.
Result<RawPicture> read_raw(const std::string& path, RawUse use);

// The same crop, not turned. Errors beside those: a sensor's filters that are no Bayer mosaic, samples that are no integers.
Result<RawCounts> read_raw_counts(const std::string& path);

}  // namespace ols
