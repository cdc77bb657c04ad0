// SPDX-License-Identifier: MIT
// Calibration: what turns a camera's counts into reflectance, and its folder on disk.
//
//   cam0/calibration.toml   how it was measured; cam1/ ... are those of the stage's other cameras
//   cam0/black.exr          counts without light, for each sample
//   cam0/flat.exr           F, counts a microsecond that r = 1 gives under one lamp (docs/architecture.md, "Units")
#pragma once

#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"
#include "stage/stage.hpp"

namespace ols {

struct CameraCalibration {
    Image black;  // one channel for mosaics and monochrome, three for rgb
    Image flat;
};

struct Calibration {
    std::string source;  // the folder, or "nominal"
    std::vector<CameraCalibration> cameras;
};

// How a calibration was measured, written beside it.
struct CalibrationRecord {
    double card_reflectance = 0;
    double card_exposure_us = 0;
    int frames = 0;  // averaged, of card and of dark each
};

// Reads a calibration folder and checks it against the stage's cameras: sizes, finite values, a flat above zero
// everywhere. Errors name the file and say to calibrate again.
Result<Calibration> read_calibration(const std::string& folder, const StageConfig& stage);

// Writes one camera's part of the folder; what is there of others stays. calibration.toml comes last, so that an interrupted one is
// not taken for a calibration.
Status write_calibration(const std::string& folder, size_t camera, const CameraCalibration& calibration,
                         const CalibrationRecord& record);

// Without a calibration: the black level and the gain that the stage states, the same for every sample.
Calibration nominal_calibration(const StageConfig& stage);

}  // namespace ols
