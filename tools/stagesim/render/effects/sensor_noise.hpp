// SPDX-License-Identifier: MIT
// Read and photon noise: sigma(mu) = read + shot sqrt(mu) counts, normal (Wenger section 4).
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class SensorNoise : public SensorEffect {
  public:
    SensorNoise(const CameraConfig& camera, uint64_t seed) : model_(camera.noise), seed_(seed) {}
    const char* name() const override { return "noise"; }
    const char* evaluation() const override { return "sample"; }
    std::string caller(const Setup& setup) const override;
    // The noise of a sample depends on seed, camera, exposure number and place alone.
    void apply(Exposure& exposure) override;

  private:
    NoiseModel model_;
    uint64_t seed_;
};

}  // namespace ols
