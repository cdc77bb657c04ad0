// SPDX-License-Identifier: MIT
// Cameras known by name: bits and noise.
#pragma once

#include <string>
#include <vector>

#include "result.hpp"
#include "stage/stage.hpp"

namespace ols {

struct CameraPreset {
    std::string name, source;  // `source`: where the figures come from, in a sentence
    int bits = 12;
    NoiseModel noise;
};

// The three cameras whose noise Wenger measured (section 4, figure 3). The paper prints figures for the first alone; of
// the others it shows a graph and says that photon noise rules over 98 % of their range. Theirs are estimates from the
// full well and read noise of sensors of their kind, which fulfil that sentence.
const std::vector<CameraPreset>& camera_presets();

// The error lists the presets there are.
Result<CameraPreset> find_camera_preset(const std::string& name);

}  // namespace ols
