// SPDX-License-Identifier: MIT
// Polygons of a file to triangles in the scene, and smooth normals.
#include "scene/mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scene/triangulate.hpp"

namespace ols {

namespace {

// A triangle of corners of the file.
struct Cut {
    std::array<uint32_t, 3> corner;  // in PolygonMesh::corners
    uint32_t group;
};

void note(std::vector<std::string>& notes, size_t count, const std::string& what) {
    if (count > 0) notes.push_back(fmt::format("{} {}", count, what));
}

Result<std::vector<Cut>> cut_polygons(const PolygonMesh& file, std::vector<std::string>& notes) {
    std::vector<Cut> cuts;
    std::vector<Vec3> places;
    std::vector<std::array<uint32_t, 3>> triangles;
    size_t without_area = 0;
    for (const PolygonMesh::Polygon& polygon : file.polygons) {
        places.clear();
        triangles.clear();
        for (uint32_t i = 0; i < polygon.corners; ++i)
            places.push_back(file.positions[file.corners[polygon.first + i].position]);
        switch (triangulate(places, triangles)) {
            case PolygonShape::simple: break;
            case PolygonShape::without_area: ++without_area; break;
            case PolygonShape::crosses_itself:
                return file.error_at(polygon.place,
                                     "crosses itself, so that nobody knows its inside: export the mesh in triangles");
            case PolygonShape::too_large:
                return file.error_at(polygon.place, fmt::format("has {} corners and may have {}: export the mesh in "
                                                                "triangles",
                                                                polygon.corners, polygon_corners_max));
        }
        for (const auto& [a, b, c] : triangles)
            cuts.push_back({{polygon.first + a, polygon.first + b, polygon.first + c}, polygon.group});
    }
    note(notes, without_area, "faces have no area and are left out");
    return cuts;
}

// Leaves out what stands there already: of two surfaces in one place a ray meets either.
void remove_doubles(const PolygonMesh& file, std::vector<Cut>& cuts, std::vector<std::string>& notes) {
    const auto places = [&](const Cut& cut) {
        std::array<uint32_t, 3> v;
        for (size_t i = 0; i < 3; ++i) v[i] = file.corners[cut.corner[i]].position;
        return v;
    };
    const auto sorted = [&](uint32_t cut) {
        auto v = places(cuts[cut]);
        std::sort(v.begin(), v.end());
        return v;
    };
    const auto turns_alike = [&](uint32_t first, uint32_t second) {
        auto a = places(cuts[first]);
        const auto b = places(cuts[second]);
        for (int i = 0; i < 3; ++i) {
            std::rotate(a.begin(), a.begin() + 1, a.end());
            if (a == b) return true;
        }
        return false;
    };
    std::vector<uint32_t> order(cuts.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const auto va = sorted(a), vb = sorted(b);
        return va != vb ? va < vb : a < b;
    });
    std::vector<bool> is_double(cuts.size(), false);
    size_t alike = 0, turned_over = 0;
    for (size_t i = 0, first = 0; i < order.size(); ++i) {
        if (i == 0 || sorted(order[i]) != sorted(order[first])) {
            first = i;
            continue;
        }
        is_double[order[i]] = true;
        ++(turns_alike(order[first], order[i]) ? alike : turned_over);
    }
    if (alike + turned_over == 0) return;
    size_t kept = 0;
    for (size_t i = 0; i < cuts.size(); ++i)
        if (!is_double[i]) cuts[kept++] = cuts[i];
    cuts.resize(kept);
    note(notes, alike, "triangles stand there twice: one of each is left out");
    note(notes, turned_over, "triangles are the back of another one: surfaces have one side here, these are left out");
}

uint64_t key_of(const PolygonMesh::Corner& corner) {
    return uint64_t(corner.position) << 32 | corner.normal;
}

// The pairs of position and normal that triangles use, each once: the vertices of the mesh.
std::vector<uint64_t> used_pairs(const PolygonMesh& file, const std::vector<Cut>& cuts) {
    std::vector<uint64_t> pairs;
    pairs.reserve(3 * cuts.size());
    for (const Cut& cut : cuts)
        for (const uint32_t corner : cut.corner) pairs.push_back(key_of(file.corners[corner]));
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
}

// Vertices of the placed mesh, with the normals that the file gives them, zero where it gives none.
Status place_vertices(const PolygonMesh& file, const std::vector<uint64_t>& pairs, const MeshPlacement& placement,
                      Mesh& mesh) {
    const Pose pose{placement.rotation, {}};
    for (const uint64_t pair : pairs) {
        const uint32_t position = uint32_t(pair >> 32), normal = uint32_t(pair);
        const Vec3 place = pose.turn(file.positions[position] * placement.scale) + placement.position_m;
        if (!(length(place) <= reach_max_m))
            return fail(
                fmt::format("'{}' reaches ({:.4g}, {:.4g}, {:.4g}) m, more than {} m from the stage's centre: "
                            "set scale to a metre over its unit (0.001 for millimetres) and position_m",
                            file.path, place.x, place.y, place.z, reach_max_m));
        mesh.positions.push_back(to_float3(place));
        mesh.file_vertices.push_back(position);
        mesh.masks.push_back(file.colors.empty() ? Float3{} : file.colors[position]);
        mesh.normals.push_back(normal == PolygonMesh::none ? Float3{}
                                                           : to_float3(pose.turn(normalized(file.normals[normal]))));
        mesh.has_own_normals |= normal != PolygonMesh::none;
    }
    return Done{};
}

void add_triangles(const PolygonMesh& file, const std::vector<Cut>& cuts, const std::vector<uint64_t>& pairs,
                   Mesh& mesh) {
    for (const Cut& cut : cuts) {
        Triangle triangle{{}, cut.group};
        for (size_t i = 0; i < 3; ++i) {
            const auto found = std::lower_bound(pairs.begin(), pairs.end(), key_of(file.corners[cut.corner[i]]));
            triangle.vertex[i] = uint32_t(found - pairs.begin());
        }
        mesh.triangles.push_back(triangle);
    }
}

// Where the faces' mean has no length, for they look opposite ways, a vertex takes after the first of them.
void fill_normals(const std::vector<uint64_t>& pairs, Mesh& mesh) {
    const std::vector<Float3> smooth = smooth_normals(mesh.positions, mesh.triangles);
    size_t opposite = 0;
    for (size_t v = 0; v < pairs.size(); ++v) {
        if (uint32_t(pairs[v]) != PolygonMesh::none) continue;
        mesh.normals[v] = smooth[v];
        opposite += length(smooth[v]) == 0;
    }
    if (opposite == 0) return;
    for (const Triangle& t : mesh.triangles) {
        const Float3 a = mesh.positions[t.vertex[0]];
        const Float3 n = normalized(cross(mesh.positions[t.vertex[1]] - a, mesh.positions[t.vertex[2]] - a));
        for (const uint32_t v : t.vertex)
            if (length(mesh.normals[v]) == 0) mesh.normals[v] = n;
    }
    note(mesh.notes, opposite, "vertices lie between faces that look opposite ways: their normal is that of the first");
}

size_t unused_vertices(const PolygonMesh& file) {
    std::vector<bool> used(file.positions.size(), false);
    for (const PolygonMesh::Corner& corner : file.corners) used[corner.position] = true;
    return size_t(std::count(used.begin(), used.end(), false));
}

}  // namespace

std::vector<Float3> smooth_normals(const std::vector<Float3>& positions, const std::vector<Triangle>& triangles) {
    std::vector<Float3> normals(positions.size());
    for (const Triangle& t : triangles) {
        const Float3 a = positions[t.vertex[0]];
        // The cross product's length is twice the area: larger faces weigh more.
        const Float3 n = cross(positions[t.vertex[1]] - a, positions[t.vertex[2]] - a);
        for (const uint32_t v : t.vertex) normals[v] = normals[v] + n;
    }
    for (Float3& n : normals) n = normalized(n);
    return normals;
}

Result<Mesh> build_mesh(const PolygonMesh& file, const MeshPlacement& placement) {
    Mesh mesh;
    mesh.notes = file.notes;
    mesh.groups = file.groups;
    mesh.has_colors = !file.colors.empty();
    auto cuts = cut_polygons(file, mesh.notes);
    if (!cuts) return cuts.error();
    remove_doubles(file, *cuts, mesh.notes);
    if (cuts->empty()) return fail("'" + file.path + "' holds no faces: export the mesh with its polygons");
    const std::vector<uint64_t> pairs = used_pairs(file, *cuts);
    if (const Status placed = place_vertices(file, pairs, placement, mesh); !placed) return placed.error();
    add_triangles(file, *cuts, pairs, mesh);
    fill_normals(pairs, mesh);
    note(mesh.notes, unused_vertices(file), "vertices belong to no face");
    return mesh;
}

Result<Mesh> read_mesh(const std::string& path, const MeshPlacement& placement) {
    const auto file = read_polygon_mesh(path);
    if (!file) return file.error();
    return build_mesh(*file, placement);
}

Mesh make_quad(Vec3 center_m, Vec3 normal, Vec3 up, double width_m, double height_m) {
    const Vec3 n = normalized(normal), right = normalized(cross(up, n)), top = cross(n, right);
    const Vec3 x = right * (width_m / 2), y = top * (height_m / 2);
    Mesh mesh;
    for (const Vec3 corner : {center_m - x - y, center_m + x - y, center_m + x + y, center_m - x + y})
        mesh.positions.push_back(to_float3(corner));
    mesh.normals.assign(4, to_float3(n));
    mesh.masks.assign(4, {});
    mesh.triangles = {{{0, 1, 2}, 0}, {{0, 2, 3}, 0}};
    mesh.groups = {"quad"};
    return mesh;
}

}  // namespace ols
