// SPDX-License-Identifier: MIT
// A mesh as its file has it: polygons in double precision, in the file's own unit and place.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "result.hpp"
#include "scene/vector.hpp"

namespace ols {

struct PolygonMesh {
    static constexpr uint32_t none = ~0u;

    struct Corner {
        uint32_t position;
        uint32_t normal = none;
    };
    struct Polygon {
        uint32_t first, corners;  // in `corners`
        uint32_t group;
        uint32_t place;  // the line of a text, or which face it is, from 0
    };

    std::string path;
    bool is_text = false;  // places are lines
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;   // of any length; zero where the file has none worth the name
    std::vector<Float3> colors;  // one a position, 0 to 1; empty without any
    std::vector<Corner> corners;
    std::vector<Polygon> polygons;
    std::vector<std::string> groups;
    std::vector<std::string> notes;  // what of the file is not used, and what was understood in its place

    // "mesh.obj:12: " or "mesh.ply: face 3: " before what is wrong there.
    Error error_at(uint32_t place, const std::string& what) const;
};

// Coordinates beyond are refused: no unit makes them lengths, and their products overflow.
constexpr double coordinate_max = 1e15;

// Files beyond are refused. Reading takes some thirty times a file's size in memory.
constexpr uint64_t mesh_bytes_max = uint64_t(1) << 30;

// Errors: a corner that names a position or normal that the file lacks. Corners whose normal has no length lose it, with a note;
// so do all if the file lists no normals at all.
Status check_corners(PolygonMesh& mesh);

// Bytes of an OBJ file. Errors name file and line.
Result<PolygonMesh> parse_obj(const std::string& path, std::string bytes);

// Bytes of a PLY file, text or binary of either byte order. Errors name the file, and the line or face.
Result<PolygonMesh> parse_ply(const std::string& path, const std::string& bytes);

// Bytes of a glTF 2.0 file, .gltf or .glb; buffers may be in the file, in its text or in files beside it. Errors name what of it
// is wrong.
Result<PolygonMesh> parse_gltf(const std::string& path, const std::string& bytes);

// Reads a mesh file of any of these kinds: the bytes say which, an OBJ file's name ends in .obj.
Result<PolygonMesh> read_polygon_mesh(const std::string& path);

}  // namespace ols
