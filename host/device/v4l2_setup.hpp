// SPDX-License-Identifier: MIT
// Setting up a V4L2 camera for a take, and reading back what it took.
#pragma once

#include <string>

#include "device/v4l2_device.hpp"
#include "image/sample_layout.hpp"
#include "stage/camera_setup.hpp"

namespace ols {

// What is in force.
struct V4l2Setup {
    CameraSetup setup;
    SampleLayout layout;
    size_t row_bytes = 0;      // from row to row
    size_t picture_bytes = 0;  // that a whole picture has at least
    std::string text;          // "RG12, at most 30 frames/s"
};

// Errors: each key of the stage's [[camera]] that the device did not take, and each control, with what it takes; the formats that
// it offers, where the mosaic or the bits are not to be had; another program streams from it. `name` is the camera's.
Result<V4l2Setup> set_up_v4l2(V4l2Device& device, const std::string& name, const CameraSetup& wanted);

}  // namespace ols
