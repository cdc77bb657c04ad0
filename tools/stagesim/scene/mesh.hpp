// SPDX-License-Identifier: MIT
// Triangle meshes, and the OBJ files they come from.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "scene/vector.hpp"

namespace ols {

struct Triangle {
    std::array<uint32_t, 3> vertex;
    uint32_t group;  // index into Mesh::groups
};

struct Mesh {
    std::vector<Float3> positions;  // metres
    std::vector<Float3> normals;    // unit, one a vertex
    std::vector<Float3> masks;      // vertex colours 0 to 1, what they mean is the material's business; (0,0,0) if none
    std::vector<Triangle> triangles;
    std::vector<std::string> groups;
    std::vector<uint32_t> file_vertices;  // of a mesh from a file: which of its `v` lines each vertex is, from 0
    bool has_own_normals = false;         // the file gave them
};

// The mean of the normals of a vertex's faces, weighted by area; unit, zero where there are none. One a position.
std::vector<Float3> smooth_normals(const std::vector<Float3>& positions, const std::vector<Triangle>& triangles);

// Reads `v x y z [r g b]`, `vn`, `g`/`o` and `f` lines; polygons become fans. Vertices without normals get the mean of
// their faces' normals weighted by area. Errors name file and line: no file, an index out of range, a bad number, no
// face at all.
Result<Mesh> read_obj(const std::string& path);

// A rectangle facing along `normal`, one group, two triangles.
Mesh make_quad(Vec3 center_m, Vec3 normal, Vec3 up, double width_m, double height_m);

}  // namespace ols
