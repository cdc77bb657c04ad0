// SPDX-License-Identifier: MIT
// Lamp geometry: the 156 lamps of Wenger section 3, and light position files (.lp).
#pragma once

#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

struct Vec3 {
    double x = 0, y = 0, z = 0;

    friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
};

double dot(Vec3 a, Vec3 b);
Vec3 cross(Vec3 a, Vec3 b);
double length(Vec3 v);
Vec3 normalized(Vec3 v);

constexpr int sphere_lamp_count = 156;
constexpr int matte_lamp_count = 6;

// Unit directions from the stage centre, x right, y up, z towards the camera: the vertices and edge midpoints of a
// once-subdivided icosahedron with a vertex at +y (42 + 120 = 162), less the vertex at -y and its five edges'
// midpoints. Ordered from the top down, each ring by azimuth from +z towards +x; lamp 0 is +y.
std::vector<Vec3> stage_lamp_directions();

// The 162 directions before the bottom six are left out; the first 156 are stage_lamp_directions().
std::vector<Vec3> full_sphere_directions();

struct LightPosition {
    std::string name;
    Vec3 direction;  // unit length
};

// Lamps that are closer stand in one direction: nobody can tell them apart, and their cells of the sphere would be empty.
inline constexpr double closest_lamps_rad = 1e-6;

// Directions named lamp_000 and so on; without any, those of stage_lamp_directions().
std::vector<LightPosition> named_lamps(const std::vector<Vec3>& directions = stage_lamp_directions());

// Reads an .lp file: the count, then `name x y z` a line. Names may hold spaces; decimal commas are understood;
// directions are normalised. A wrong count, a zero vector or a line that is no light is an error that names file and
// line.
Result<std::vector<LightPosition>> read_lp(const std::string& path);

// Writes an .lp file sorted by name, unit vectors, decimal points.
Status write_lp(const std::string& path, std::vector<LightPosition> lights);

}  // namespace ols
