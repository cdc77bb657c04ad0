// SPDX-License-Identifier: MIT
// The presets' figures.
#include "stage/camera_presets.hpp"

#include <cmath>

namespace ols {

namespace {

// Electrons as counts of a camera whose full well is its full scale: a count is full_well / full_scale electrons, and n
// electrons vary by sqrt(n).
NoiseModel noise_of(double full_well_electrons, double read_electrons, int bits) {
    const double electrons_per_count = full_well_electrons / ((1 << bits) - 1);
    return {read_electrons / electrons_per_count, 1 / std::sqrt(electrons_per_count)};
}

}  // namespace

const std::vector<CameraPreset>& camera_presets() {
    static const std::vector<CameraPreset> presets = {
        {"phantom_v7.1", "Vision Research Phantom v7.1, measured: Wenger section 4", 12, {2.68, 0.492}},
        {"canon_d30", "Canon D30, estimated: 10 um pixels of 50 000 electrons, read noise 18 electrons", 12,
         noise_of(50000, 18, 12)},
        {"qimaging_qicam",
         "QImaging QICam, cooled, estimated: 4.65 um pixels of 18 000 electrons, read noise 12 electrons", 12,
         noise_of(18000, 12, 12)}};
    return presets;
}

Result<CameraPreset> find_camera_preset(const std::string& name) {
    std::string known;
    for (const auto& preset : camera_presets()) {
        if (preset.name == name) return preset;
        known += (known.empty() ? "" : ", ") + preset.name;
    }
    return fail("there is no camera preset '" + name + "': choose one of " + known);
}

}  // namespace ols
