// SPDX-License-Identifier: MIT
// The converter: adds the black level, rounds to whole counts, and saturates.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Quantisation : public SensorEffect {
  public:
    explicit Quantisation(const CameraConfig& camera) : black_(float(camera.black)), white_(float(camera.white)) {}
    const char* name() const override { return "quantisation"; }
    const char* evaluation() const override { return "sample"; }
    std::string caller(const Setup& setup) const override;
    void apply(Exposure& exposure) override;

  private:
    float black_, white_;
};

}  // namespace ols
