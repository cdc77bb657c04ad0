// SPDX-License-Identifier: MIT
// Recordings of moving scenes: the frames that targets are developed from, and the truth of each target's moment, kept on disk
// because rendering them takes minutes.
#pragma once

#include <string>
#include <vector>

#include "develop/motion_developer.hpp"
#include "render/effects/effect.hpp"
#include "stage/calibration.hpp"

namespace ols {

// What is recorded.
struct RecordingPlan {
    std::string scene;  // a file of the virtual stage
    std::string basis;
    int width = 320, height = 240;
    // Targets stand at the tracking slot in the middle of this cycle, of every half cycle from there on; recorded is a cycle on
    // either side of them.
    uint32_t cycle = 2;
    int targets = 1;
    bool is_frozen = false;  // at the first target's moment: nothing but noise is left
};

// With nominal calibration and, where the sequence states none, the exposure that `stagectl basis report` proposes.
struct Recording {
    Scene scene;
    StageConfig stage;
    Sequence sequence;
    CameraCalibration calibration;
    std::vector<TargetFrames> targets;

    const CameraConfig& camera() const { return stage.cameras[0]; }
    // Time of the scene at the middle of the tracking exposure that a target stands for.
    double target_us(size_t target) const;
};

// Reads the frames from `folder`, or renders and leaves them there, under a name that has a hash of scene and plan in it; with an
// empty folder nothing is kept. Shows progress on a terminal.
// Errors: those of the scene and the basis; the folder cannot be written.
Result<Recording> record(const RecordingPlan& plan, const std::string& folder);

// For its targets, half a cycle from one to the next.
MotionDeveloper developer_of(const Recording& recording, const MotionQuality& quality, DevelopOptions options = {});

// What each lamp alone shows at the first target's moment, in r (docs/architecture.md, "Units"): [lamp][pixel], a mosaic
// like the frames. Kept like them, once for all bases.
Result<std::vector<std::vector<float>>> true_lamps(const Recording& recording, const RecordingPlan& plan,
                                                   const std::string& folder);

}  // namespace ols
