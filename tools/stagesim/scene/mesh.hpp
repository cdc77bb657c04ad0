// SPDX-License-Identifier: MIT
// Triangle meshes as they stand in the scene, made of the polygons of files.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "scene/motion.hpp"
#include "scene/polygon_mesh.hpp"

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
    std::vector<uint32_t> file_vertices;  // of a mesh from a file: which of its vertices each is, from 0
    bool has_own_normals = false;         // the file gave some
    bool has_colors = false;              // the file gave them, and they are the masks
    std::vector<std::string> notes;       // what of the file is not used, and what was understood in its place
};

// Where a mesh of a file is put: scaled, then turned, then moved.
struct MeshPlacement {
    double scale = 1;
    Quaternion rotation = {1, 0, 0, 0};
    Vec3 position_m;
};

constexpr double reach_max_m = 1000;  // from the stage's centre: single precision still tells 0.1 mm apart there

// The mean of the normals of a vertex's faces, weighted by area; unit, zero where there are none. One a position.
std::vector<Float3> smooth_normals(const std::vector<Float3>& positions, const std::vector<Triangle>& triangles);

// Cuts polygons into triangles (scene/triangulate.hpp) and puts them into their place, in double precision up to there. Corners
// without a normal get the mean of the normals of those faces that give them none, weighted by area. Vertices without a face,
// faces without area and faces that stand there twice are left out and noted. Errors name the file and the face: one that
// crosses itself or has too many corners, none at all, a mesh that reaches beyond reach_max_m.
Result<Mesh> build_mesh(const PolygonMesh& file, const MeshPlacement& placement);

// Reads a mesh file (scene/polygon_mesh.hpp) and builds it.
Result<Mesh> read_mesh(const std::string& path, const MeshPlacement& placement = {});

// A rectangle facing along `normal`, one group, two triangles.
Mesh make_quad(Vec3 center_m, Vec3 normal, Vec3 up, double width_m, double height_m);

}  // namespace ols
