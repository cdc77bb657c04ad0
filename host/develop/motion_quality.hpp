// SPDX-License-Identifier: MIT
// Motion quality: how exactly motion is compensated, by presets on the front of error over time (docs/accuracy.md).
#pragma once

#include <string>
#include <vector>

#include "develop/group_motion.hpp"
#include "develop/tracking_flows.hpp"
#include "result.hpp"

namespace ols {

struct MotionQuality {
    std::string name = "none";
    // Without, frames are taken as they are.
    bool compensates = false;
    TrackingFlowOptions flow = {};
    // Flow is found between tracking frames that are at least that far apart on average, the targets' own among them however near
    // they are (evenly_apart() in lazy_basis.hpp), and the subject taken to move evenly between; 0: between all.
    double flow_apart_s = 0;
    // Runs of samples whose vectors lie that near to a line are warped along it (group_motion.hpp).
    float line_tolerance_steps = GroupMotion::default_tolerance;
    // Whether samples follow the brightness of the tracking frames where alignment leaves it different
    // (develop/followed_brightness.hpp).
    bool follows_brightness = true;
    // Whether slots are blended of their frames before and after the target, or taken from the nearer one
    // (develop/slot_interpolation.hpp).
    bool interpolates = false;
    // The motion before and after a target that goes with it into the archive, for motion blur: a shutter of 360 degrees at 24
    // targets a second.
    double motion_reach_s = 1 / 48.0;
};

// none, preview, standard, final.
std::vector<std::string> motion_quality_names();

// Error: no such quality; says which there are.
Result<MotionQuality> motion_quality(const std::string& name);

}  // namespace ols
