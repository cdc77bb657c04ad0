// SPDX-License-Identifier: MIT
// Setting a GenICam camera up for a take, by the names of the Standard Features Naming Convention (SFNC 2.7: chapters "Image Format
// Control", "Acquisition Control" and "Chunk Data Control"), and what it made of it.
#pragma once

#include <optional>
#include <string>

#include "device/aravis_features.hpp"
#include "image/sample_layout.hpp"
#include "stage/camera_setup.hpp"

namespace ols {

// The layout of a pixel format by its name (PFNC 2.4): Mono and Bayer of 8 to 16 bits, unpacked, "p" and "Packed".
std::optional<SampleLayout> sample_layout_of(const std::string& pixel_format);

struct AravisSetup {
    CameraSetup in_force;  // read back
    std::string pixel_format;
    std::optional<SampleLayout> layout;  // of that; nothing when frames of it cannot be read
    uint32_t pixel_code = 0;             // PFNC's
    int64_t offset_x = 0, offset_y = 0;  // of the region in the sensor
    bool has_chunk_time = false;         // frames carry the time of their exposure
};

// Sets all up. The error names each key of [[camera]] that differs, the features that this model lacks, and what else is in the way of
// a take.
Result<AravisSetup> set_up_camera(AravisFeatures& camera, const std::string& name, const CameraSetup& wanted);

}  // namespace ols
