// SPDX-License-Identifier: MIT
// The stage as configured (stage.toml): lamps and their places, the chain, the board, the cameras.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "image/frame.hpp"
#include "result.hpp"
#include "stage/camera_setup.hpp"
#include "stage/daemon_setup.hpp"
#include "stage/gpio_setup.hpp"
#include "stage/lamp_response.hpp"
#include "stage/lamps.hpp"
#include "stage/telemetry_setup.hpp"

namespace ols {

// sigma(mu) = read + shot * sqrt(mu) in counts, as Wenger section 4 fits it (standard deviations add, not variances).
struct NoiseModel {
    double read_counts = 2.68;
    double shot = 0.492;
};

struct CameraConfig : CameraSetup {
    std::string source = "";          // "ring:PATH" (device/camera.hpp)
    double black = 64, white = 4095;  // counts
    NoiseModel noise;
    int trigger = 0;  // which of the board's four trigger lines
    std::array<double, 3> position_m = {0, 0, 1.6}, look_at_m = {0, 0, 0}, up = {0, 1, 0};
    double vertical_fov_deg = 16;
    // Vignetting: 1 - k r^2, r = 1 in the corner.
    double vignetting = 0.25;
    // Counts a microsecond that r = 1 gives under one lamp at the stage centre, on the axis. The paper's camera: a 98.5
    // % card shows 25 % of saturation in 412 us under one lamp (section 5.1).
    double counts_per_us = 2.52;
};

struct StageConfig {
    std::vector<LightPosition> lamps;    // sphere lamps, names lamp_000 ...
    double radius_m = 1.0;               // lamps' distance from the centre
    double lamp_beam_exponent = 1.2;     // beam falls off as cos^n off the lamp's axis, which points at the centre
    LampResponse lamp_response;          // of every lamp with its driver
    std::vector<Vec3> matte_lamps_m;     // the matte board's lamps, absolute positions
    int chain_bits = 176;                // 0: no chain, see check_chain()
    std::vector<int> chain_bit_of_lamp;  // sphere lamps first, then matte lamps; none without a chain
    std::string board = "";              // "socket:PATH"
    std::vector<CameraConfig> cameras;
    GpioSetup gpio;
    TelemetrySetup telemetry;
    DaemonSetup daemon;
    std::string calibration_dir = "";  // "" = none yet

    int lamp_count() const { return int(lamps.size() + matte_lamps_m.size()); }
};

// The stage of Wenger section 3 with one camera and everything else at its default.
StageConfig default_stage();

// Reads stage.toml; every key has the default of default_stage(). `[lamps] lp = "file.lp"` replaces the geometry (paths
// are relative to the file). Unknown keys and values out of range are errors that name file, line and key.
// Without a [chain] lamp i is bit i; more lamps than a chain can have are then read, too, without a chain.
Result<StageConfig> read_stage(const std::string& path);

// Whether a board can play the stage. The error says what else can be done with it.
Status check_chain(const StageConfig& stage);

}  // namespace ols
