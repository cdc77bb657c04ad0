// SPDX-License-Identifier: MIT
// The lens darkens the picture towards the corners: 1 - k r^2, r = 1 in the corner.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Vignetting : public SensorEffect {
  public:
    explicit Vignetting(const CameraConfig& camera) : strength_(float(camera.vignetting)) {}
    const char* name() const override { return "vignetting"; }
    const char* evaluation() const override { return "pixel"; }
    std::string caller(const Setup& setup) const override;
    void apply(Exposure& exposure) override;

    // The factor in the middle of pixel (x, y) of a picture of width x height.
    static float factor(float strength, int x, int y, int width, int height);

  private:
    float strength_;
};

}  // namespace ols
