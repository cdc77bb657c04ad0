// SPDX-License-Identifier: MIT
// The options that every verb takes: scene, stage, camera, effects.
#pragma once

#include <CLI/CLI.hpp>
#include <set>

#include "render/effects/effect.hpp"

namespace ols {

struct InputOptions {
    std::string scene, stage;
    int camera = 0;
    std::vector<std::string> disabled;

    std::set<std::string> disabled_set() const { return {disabled.begin(), disabled.end()}; }
};

void add_input_options(CLI::App& verb, InputOptions& options);

// Lets through numbers of a range, both ends included, and nothing else: no NaN.
CLI::Validator number_from(double min, double max);

struct Inputs {
    Scene scene;
    StageConfig stage;
    CameraConfig camera;

    Setup setup(bool camera_model) const { return {scene, stage, camera, camera_model}; }
};

// Reads what the options name; without --stage it is the default stage. Says on standard error what of the scene's files is not
// used. Errors: also a camera and samples that this machine's memory cannot hold.
Result<Inputs> read_inputs(const InputOptions& options);

// A bar on a terminal, nothing elsewhere; 1 ends it.
void show_progress(const char* what, double done);

}  // namespace ols
