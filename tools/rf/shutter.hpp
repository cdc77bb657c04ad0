// SPDX-License-Identifier: MIT
// The options by which the verbs of rf blur a picture along its target's motion, and what they report of it.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "relight/motion_blur.hpp"

namespace ols {

struct ShutterOptions {
    double angle_deg = 0;  // 0: no blur
    double phase_deg = 0;
    double step_px = MotionBlurOptions().step_px;

    void add_to(CLI::App& verb);
    bool is_open() const { return angle_deg > 0; }
    std::map<std::string, std::string> header_attributes() const;
};

// An error that names the first target without motion and says how to get some; to be asked before anything is written.
Status check_motion_known(const ArchiveReader& archive, const std::string& path,
                          const std::vector<TargetEntry>& targets);

// The target's picture blurred along the target's motion, at the take's frame rate. Errors begin with `file`.
Result<BlurredImage> through_shutter(const TargetReader& target, const std::string& file, double frame_rate_hz,
                                     const Image& sharp, const ShutterOptions& options, int threads);

// One line each: motion that was not known for all of the exposure, pixels that saw nothing.
std::vector<std::string> shutter_warnings(const BlurredImage& blurred);

nlohmann::json shutter_report(const ShutterOptions& options, const BlurredImage& blurred);

}  // namespace ols
