// SPDX-License-Identifier: MIT
// How a camera is to be set up for a take: what a driver asks of the device, and reads back.
#pragma once

#include <map>
#include <string>

#include "image/frame.hpp"

namespace ols {

// Which edge of its trigger line a camera takes as the begin of an exposure.
enum class TriggerActivation { rising_edge, falling_edge };

// What ends the exposure: the trigger line going back (the board's exposure times then rule), or the camera's own timer.
enum class ExposureMode { trigger_width, timed };

struct CameraSetup {
    int width = 640, height = 480;  // pixels
    Cfa cfa = Cfa::rggb;
    int bits = 12;                    // of a sample
    std::string trigger_source = "";  // the camera's input, by the camera's own name for it ("Line1"); "" as it comes
    TriggerActivation trigger_activation = TriggerActivation::rising_edge;
    double trigger_delay_us = 0;  // from the edge to the begin of the exposure
    ExposureMode exposure_mode = ExposureMode::trigger_width;
    double exposure_us = 100;                     // of ExposureMode::timed
    std::map<std::string, std::string> controls;  // settings of the device's own, by its names for them: "Gain" is "12"

    // Of a frame in memory: a 16-bit word a sample.
    size_t frame_bytes() const {
        return size_t(width) * size_t(height) * size_t(samples_per_pixel(cfa)) * sizeof(uint16_t);
    }
};

}  // namespace ols
