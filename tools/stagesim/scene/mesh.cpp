// SPDX-License-Identifier: MIT
// OBJ reading and smooth normals.
#include "scene/mesh.hpp"

#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string_view>

namespace ols {

namespace {

using Words = std::vector<std::string_view>;

Words split(std::string_view line) {
    Words words;
    for (size_t i = 0; (i = line.find_first_not_of(" \t\r", i)) != line.npos;) {
        const size_t end = std::min(line.find_first_of(" \t\r", i), line.size());
        words.push_back(line.substr(i, end - i));
        i = end;
    }
    return words;
}

template <typename T>
std::optional<T> number(std::string_view word) {
    T value{};
    const auto parsed = std::from_chars(word.data(), word.data() + word.size(), value);
    if (parsed.ec != std::errc() || parsed.ptr != word.data() + word.size()) return std::nullopt;
    return value;
}

std::optional<Float3> triple(const Words& words, size_t first) {
    if (words.size() < first + 3) return std::nullopt;
    const auto x = number<float>(words[first]), y = number<float>(words[first + 1]),
               z = number<float>(words[first + 2]);
    if (!x || !y || !z || !std::isfinite(*x) || !std::isfinite(*y) || !std::isfinite(*z)) return std::nullopt;
    return Float3{*x, *y, *z};
}

// An OBJ file as it is read: a vertex of the mesh is one pair of position and normal of the file.
class ObjParser {
  public:
    // False when the line is not understood.
    bool line(std::string_view text) {
        const Words words = split(text);
        if (words.empty()) return true;
        if (words[0] == "v") return position(words);
        if (words[0] == "vn") return normal(words);
        if (words[0] == "g" || words[0] == "o") return group(words);
        if (words[0] == "f") return face(words);
        return true;  // texture coordinates, materials and comments have no part in this
    }

    Mesh take() {
        mesh_.has_own_normals = !normals_.empty();
        if (normals_.empty()) mesh_.normals = smooth_normals(mesh_.positions, mesh_.triangles);
        return std::move(mesh_);
    }

  private:
    bool position(const Words& words) {
        const auto p = triple(words, 1);
        const auto mask = words.size() >= 7 ? triple(words, 4) : Float3{};
        if (!p || !mask) return false;
        positions_.push_back(*p);
        masks_.push_back(*mask);
        return true;
    }

    bool normal(const Words& words) {
        const auto n = triple(words, 1);
        if (n) normals_.push_back(normalized(*n));
        return n.has_value();
    }

    bool group(const Words& words) {
        mesh_.groups.emplace_back(words.size() > 1 ? words[1] : "default");
        return true;
    }

    // `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or from the end if negative.
    std::optional<uint32_t> corner(std::string_view word) {
        int64_t index[3] = {0, 0, 0};
        for (int part = 0; part < 3 && !word.empty(); ++part) {
            const size_t end = std::min(word.find('/'), word.size());
            if (end > 0) {
                const auto value = number<int64_t>(word.substr(0, end));
                if (!value) return std::nullopt;
                index[part] = *value;
            }
            word.remove_prefix(std::min(end + 1, word.size()));
        }
        const auto place = [](int64_t i, size_t count) { return i < 0 ? int64_t(count) + i : i - 1; };
        const int64_t v = place(index[0], positions_.size());
        const int64_t n = index[2] == 0 ? -1 : place(index[2], normals_.size());
        if (v < 0 || v >= int64_t(positions_.size()) || n >= int64_t(normals_.size())) return std::nullopt;
        if (index[2] == 0 && !normals_.empty()) return std::nullopt;  // normals for some corners only
        const auto [entry, is_new] = vertices_.try_emplace({v, n}, uint32_t(mesh_.positions.size()));
        if (is_new) {
            mesh_.positions.push_back(positions_[v]);
            mesh_.masks.push_back(masks_[v]);
            mesh_.file_vertices.push_back(uint32_t(v));
            mesh_.normals.push_back(n < 0 ? Float3{} : normals_[n]);
        }
        return entry->second;
    }

    bool face(const Words& words) {
        if (words.size() < 4) return false;
        if (mesh_.groups.empty()) mesh_.groups.push_back("default");
        std::vector<uint32_t> corners;
        for (size_t i = 1; i < words.size(); ++i) {
            const auto vertex = corner(words[i]);
            if (!vertex) return false;
            corners.push_back(*vertex);
        }
        const uint32_t group = uint32_t(mesh_.groups.size() - 1);
        for (size_t i = 2; i < corners.size(); ++i)
            mesh_.triangles.push_back({{corners[0], corners[i - 1], corners[i]}, group});
        return true;
    }

    std::vector<Float3> positions_, masks_, normals_;
    std::map<std::pair<int64_t, int64_t>, uint32_t> vertices_;
    Mesh mesh_;
};

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

Result<Mesh> read_obj(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file)
        return fail("cannot open mesh '" + path + "': check the path (the demo's head comes with `make assets`)");
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    ObjParser parser;
    int number = 0;
    for (size_t begin = 0; begin < text.size();) {
        const size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view line = std::string_view(text).substr(begin, end - begin);
        ++number;
        if (!parser.line(line))
            return fail(
                fmt::format("{}:{}: '{}' is no valid OBJ line: numbers must be finite, indices must name earlier "
                            "vertices, and either all or no corners have normals",
                            path, number, line.substr(0, 60)));
        begin = end + 1;
    }
    Mesh mesh = parser.take();
    if (mesh.triangles.empty()) return fail("'" + path + "' holds no faces: export the mesh with its polygons");
    return mesh;
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
