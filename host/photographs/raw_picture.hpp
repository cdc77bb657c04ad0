// SPDX-License-Identifier: MIT
// Camera RAW through LibRaw: the sensor's own samples, or linear R G B.
#pragma once

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

// Whether LibRaw knows the file as a camera's raw.
bool is_camera_raw(const std::string& path);

// The default crop of a DNG file (DNG 1.4, DefaultCropOrigin and DefaultCropSize) is taken, of others the active area. Errors name
// the file: damaged, no Bayer mosaic where one is asked for, too large.
Result<RawPicture> read_raw(const std::string& path, RawUse use);

}  // namespace ols
