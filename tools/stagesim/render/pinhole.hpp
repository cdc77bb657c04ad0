// SPDX-License-Identifier: MIT
// The camera's rays.
#pragma once

#include <array>

#include "scene/vector.hpp"
#include "stage/stage.hpp"

namespace ols {

// A pinhole camera; image coordinates are pixels from the top left corner, x right, y down.
class Pinhole {
  public:
    explicit Pinhole(const CameraConfig& camera);

    Float3 position() const { return position_; }
    // Unit direction through the image point (x, y).
    Float3 ray(double x, double y) const;
    // The image point of a place before the camera.
    std::array<double, 2> project(Float3 place) const;
    // The pixels, from the first to one past the last in both directions, out of width x height, in which a place of the box
    // between two corners may be seen.
    struct Pixels {
        int left, top, right, bottom;
    };
    Pixels cover(const std::array<Float3, 2>& box, int width, int height) const;
    // Radians, in the middle of the image.
    float pixel_angle() const { return float(length(right_)); }

  private:
    Float3 position_;
    Vec3 forward_, right_, down_;  // right and down reach one pixel at unit distance
    double center_x_, center_y_;
};

}  // namespace ols
