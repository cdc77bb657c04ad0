// SPDX-License-Identifier: MIT
// A sensor of one sample a pixel sees one colour of it, or, without a colour filter, the mean of the three.
#pragma once

#include "render/effects/effect.hpp"

namespace ols {

class Mosaic : public Effect {
  public:
    explicit Mosaic(const CameraConfig& camera) : cfa_(camera.cfa) {}
    const char* name() const override { return "mosaic"; }
    const char* evaluation() const override { return "pixel and lamp"; }
    std::string caller(const Setup& setup) const override;

    // What pixel (x, y) keeps of its colour.
    float keep(const float (&rgb)[3], int x, int y) const {
        if (cfa_ == Cfa::none) return (rgb[0] + rgb[1] + rgb[2]) / 3;
        return rgb[cfa_color(cfa_, x, y)];
    }

  private:
    Cfa cfa_;
};

}  // namespace ols
