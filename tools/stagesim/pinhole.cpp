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

std::array<double, 2> Pinhole::project(Float3 place) const {
    const Vec3 way = Vec3{place.x, place.y, place.z} - Vec3{position_.x, position_.y, position_.z};
    const double depth = dot(way, forward_);
    // right_ and down_ are a pixel long at unit distance, and at right angles.
    return {center_x_ + dot(way, right_) / (dot(right_, right_) * depth),
            center_y_ + dot(way, down_) / (dot(down_, down_) * depth)};
}

}  // namespace ols
