// SPDX-License-Identifier: MIT
// The once-subdivided icosahedron, and .lp writing.
#include "stage/lamps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "image/whole_file.hpp"
#include "stage/light_file.hpp"

namespace ols {

double dot(Vec3 a, Vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

double length(Vec3 v) {
    return std::sqrt(dot(v, v));
}

Vec3 normalized(Vec3 v) {
    return v * (1 / length(v));
}

namespace {

// The 12 vertices: the poles on the y axis, two rings of five at latitude atan(1/2), turned by 36 degrees.
std::vector<Vec3> icosahedron() {
    std::vector<Vec3> vertices = {{0, 1, 0}, {0, -1, 0}};
    const double y = 1 / std::sqrt(5.0), r = 2 / std::sqrt(5.0);
    for (int i = 0; i < 5; ++i) {
        const double upper = 2 * std::numbers::pi * i / 5, lower = upper + std::numbers::pi / 5;
        vertices.push_back({r * std::sin(upper), y, r * std::cos(upper)});
        vertices.push_back({r * std::sin(lower), -y, r * std::cos(lower)});
    }
    return vertices;
}

// Adds the midpoint of every edge, pushed out to the sphere: an edge is a pair closer than `longest_edge`.
std::vector<Vec3> with_edge_midpoints(const std::vector<Vec3>& vertices, double longest_edge) {
    std::vector<Vec3> all = vertices;
    for (size_t i = 0; i < vertices.size(); ++i)
        for (size_t j = i + 1; j < vertices.size(); ++j)
            if (length(vertices[i] - vertices[j]) < longest_edge) all.push_back(normalized(vertices[i] + vertices[j]));
    return all;
}

// Top to bottom, then azimuth; coordinates are compared on a grid coarser than rounding errors.
bool above(Vec3 a, Vec3 b) {
    const auto grid = [](double v) { return std::lround(v * 1e6); };
    const auto azimuth = [&](Vec3 v) {
        const double angle = std::atan2(v.x, v.z);
        return grid(angle < -1e-9 ? angle + 2 * std::numbers::pi : angle);
    };
    if (grid(a.y) != grid(b.y)) return a.y > b.y;
    return azimuth(a) < azimuth(b);
}

}  // namespace

std::vector<Vec3> full_sphere_directions() {
    // Halved twice: 12 corners and their 30 midpoints make the 42 vertices (edges 0.5465 and 0.6180) of the
    // once-subdivided icosahedron; lamps sit on these and on the middles of its 120 edges.
    auto points = with_edge_midpoints(with_edge_midpoints(icosahedron(), 1.06), 0.63);
    // The lowest vertex and the middles of its five edges are the last six of this order.
    std::sort(points.begin(), points.end(), above);
    return points;
}

std::vector<Vec3> stage_lamp_directions() {
    auto points = full_sphere_directions();
    points.resize(sphere_lamp_count);
    return points;
}

Result<std::vector<LightPosition>> read_lp(const std::string& path) {
    auto file = read_light_file(path);
    if (!file) return file.error();
    if (!file->intensities.empty())
        return fail("'" + path +
                    "' has intensities behind the directions: only `stagectl ingest` uses them; remove them");
    return std::move(file->lights);
}

std::vector<LightPosition> named_lamps(const std::vector<Vec3>& directions) {
    std::vector<LightPosition> lamps;
    for (size_t i = 0; i < directions.size(); ++i) lamps.push_back({fmt::format("lamp_{:03}", i), directions[i]});
    return lamps;
}

Status write_lp(const std::string& path, std::vector<LightPosition> lights) {
    std::sort(lights.begin(), lights.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    std::string text = fmt::format("{}\n", lights.size());
    for (const auto& light : lights) {
        const Vec3 d = normalized(light.direction);
        text += fmt::format("{} {:.9f} {:.9f} {:.9f}\n", light.name, d.x, d.y, d.z);
    }
    return write_whole_file(path, text);
}

}  // namespace ols
