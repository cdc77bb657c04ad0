// SPDX-License-Identifier: MIT
// What holds for meshes of every kind of file.
#include "scene/polygon_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "image/input_file.hpp"

namespace ols {

Error PolygonMesh::error_at(uint32_t place, const std::string& what) const {
    return fail(is_text ? fmt::format("{}:{}: {}", path, place, what)
                        : fmt::format("'{}': face {} {}", path, place, what));
}

Status check_corners(PolygonMesh& mesh) {
    const bool lists_normals = !mesh.normals.empty();
    size_t unlisted = 0, without_length = 0;
    for (const PolygonMesh::Polygon& polygon : mesh.polygons)
        for (uint32_t i = polygon.first; i < polygon.first + polygon.corners; ++i) {
            PolygonMesh::Corner& corner = mesh.corners[i];
            if (corner.position >= mesh.positions.size())
                return mesh.error_at(polygon.place, fmt::format("names vertex {}, and the file has {}",
                                                                corner.position + mesh.is_text, mesh.positions.size()));
            if (corner.normal == PolygonMesh::none) continue;
            if (lists_normals && corner.normal >= mesh.normals.size())
                return mesh.error_at(polygon.place, fmt::format("names normal {}, and the file has {}",
                                                                corner.normal + mesh.is_text, mesh.normals.size()));
            const bool has_length = lists_normals && length(mesh.normals[corner.normal]) > 0;
            if (has_length) continue;
            ++(lists_normals ? without_length : unlisted);
            corner.normal = PolygonMesh::none;
        }
    if (unlisted > 0)
        mesh.notes.push_back(
            fmt::format("{} corners name normals and the file lists none: theirs come from their faces", unlisted));
    if (without_length > 0)
        mesh.notes.push_back(
            fmt::format("{} corners have a normal of no length: theirs come from their faces", without_length));
    return Done{};
}

Result<PolygonMesh> read_polygon_mesh(const std::string& path) {
    auto bytes = read_input(path, "mesh", mesh_bytes_max);
    if (!bytes) return fail(bytes.error().message + " (the demo's head comes with `make assets`)");
    std::string ending = std::filesystem::path(path).extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    if (bytes->starts_with("ply\n") || bytes->starts_with("ply\r")) return parse_ply(path, *bytes);
    if (bytes->starts_with("glTF") || ending == ".gltf") return parse_gltf(path, *bytes);
    if (ending == ".obj") return parse_obj(path, std::move(*bytes));
    return fail("'" + path + "' is no mesh that is known here: OBJ (its name ends in .obj), PLY and glTF are read; " +
                "export it as one of these");
}

}  // namespace ols
