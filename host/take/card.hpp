// SPDX-License-Identifier: MIT
// Card: measures black level and flat field with a white card that fills the view (Wenger 5.1).
#pragma once

#include <atomic>
#include <nlohmann/json.hpp>
#include <string>

#include "record/recorder.hpp"
#include "stage/calibration.hpp"

namespace ols {

struct CardOptions {
    double reflectance = 0.985;  // of the card
    double exposure_us = 0;      // 0: such that a card facing the camera reaches 60 % of the range
    int cycles = 16;             // of 8 card and 8 dark frames each
    uint32_t camera = 0;         // which of the stage's
};

struct CardCalibration {
    CameraCalibration calibration;
    CalibrationRecord record;
    RecordReport report;
    double black_mean = 0, flat_mean = 0;
    double brightest = 0;  // of the averaged card, share of the range above black

    // What was measured, and the folder that it was written to.
    nlohmann::json to_json(const std::string& folder) const;
    std::string to_text() const;
};

// Plays dark slots and slots with all sphere lamps in turn, averages each kind over all frames (a plain mean: noise falls
// with the root of their number) and divides by the light that falls on a card that faces the camera:
// F = (card - black) / (t rho sum over lamps of max(0, n . l)). One average for the whole view; the card must fill it.
// Errors: a saturated sample, a card darker than a tenth of the range, a view that the card does not fill, missing
// frames of a kind. `monitor`: as record_take()'s.
Result<CardCalibration> calibrate_with_card(Board& board, Camera& camera, const StageConfig& stage,
                                            const CardOptions& options, const StopRequest& stop,
                                            const std::function<void(uint64_t, uint64_t)>& progress,
                                            RecordMonitor* monitor = nullptr);

}  // namespace ols
