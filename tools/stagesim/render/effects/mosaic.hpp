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

    // Whether a pixel keeps one of its colours, color_at(x, y); else it keeps their mean.
    bool keeps_one_color() const { return cfa_ != Cfa::none; }
    int color_at(int x, int y) const { return cfa_color(cfa_, x, y); }

  private:
    Cfa cfa_;
};

}  // namespace ols
