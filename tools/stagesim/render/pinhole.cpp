// SPDX-License-Identifier: MIT
// Square pixels; the vertical field of view spans the image's height.
#include "render/pinhole.hpp"

#include <algorithm>
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

Pinhole::Pixels Pinhole::cover(const std::array<Float3, 2>& box, int width, int height) const {
    double left = width, top = height, right = 0, bottom = 0;
    for (int i = 0; i < 8; ++i) {
        const Float3 corner{box[i & 1].x, box[i >> 1 & 1].y, box[i >> 2].z};
        const Float3 way = corner - position_;
        const double depth = dot(Vec3{way.x, way.y, way.z}, forward_);
        // A box that reaches behind the camera may be anywhere, and one around nothing is infinite.
        if (!std::isfinite(depth) || depth < 1e-3) return {0, 0, width, height};
        const auto [x, y] = project(corner);
        left = std::min(left, x), right = std::max(right, x);
        top = std::min(top, y), bottom = std::max(bottom, y);
    }
    // A pixel more, for rounding.
    const auto pixel = [](double at, int size) { return int(std::clamp(std::floor(at), 0.0, double(size))); };
    return {pixel(left - 1, width), pixel(top - 1, height), pixel(right + 2, width), pixel(bottom + 2, height)};
}

}  // namespace ols
