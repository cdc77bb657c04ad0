// SPDX-License-Identifier: MIT
// Square pixels; the vertical field of view spans the image's height.
#include "pinhole.hpp"

#include <numbers>

namespace ols {

namespace {

Vec3 to_vec3(const std::array<double, 3>& a) {
    return {a[0], a[1], a[2]};
}

}  // namespace

Pinhole::Pinhole(const CameraConfig& camera)
    : position_(to_float3(to_vec3(camera.position_m))), center_x_(camera.width / 2.0), center_y_(camera.height / 2.0) {
    const double pixel = 2 * std::tan(camera.vertical_fov_deg * std::numbers::pi / 360) / camera.height;
    forward_ = normalized(to_vec3(camera.look_at_m) - to_vec3(camera.position_m));
    const Vec3 right = normalized(cross(forward_, to_vec3(camera.up)));
    right_ = right * pixel;
    down_ = cross(forward_, right) * pixel;
}

Float3 Pinhole::ray(double x, double y) const {
    return to_float3(normalized(forward_ + right_ * (x - center_x_) + down_ * (y - center_y_)));
}

}  // namespace ols
