// SPDX-License-Identifier: MIT
// The camera's rays.
#pragma once

#include "stage/stage.hpp"
#include "vector.hpp"

namespace ols {

// A pinhole camera; image coordinates are pixels from the top left corner, x right, y down.
class Pinhole {
  public:
    explicit Pinhole(const CameraConfig& camera);

    Float3 position() const { return position_; }
    // Unit direction through the image point (x, y).
    Float3 ray(double x, double y) const;

  private:
    Float3 position_;
    Vec3 forward_, right_, down_;  // right and down reach one pixel at unit distance
    double center_x_, center_y_;
};

}  // namespace ols
