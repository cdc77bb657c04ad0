// SPDX-License-Identifier: MIT
// glTF 2.0 (specification 3.5 to 3.7): the triangles of the nodes of a scene, each moved to its node's place.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include "scene/gltf_buffers.hpp"
#include "scene/polygon_mesh.hpp"

namespace ols {

namespace {

using nlohmann::json;

[[noreturn]] void wrong(const std::string& what) {
    throw std::runtime_error(what);
}

// A linear map and a translation.
struct Place {
    std::array<Vec3, 3> columns = {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    Vec3 origin;

    Vec3 turn(Vec3 v) const { return columns[0] * v.x + columns[1] * v.y + columns[2] * v.z; }
    Vec3 point(Vec3 v) const { return turn(v) + origin; }
    double determinant() const { return dot(columns[0], cross(columns[1], columns[2])); }
    // Of a surface's normal: the cofactors, which are the transposed inverse times the determinant.
    Vec3 turn_normal(Vec3 n) const {
        const Vec3 turned = cross(columns[1], columns[2]) * n.x + cross(columns[2], columns[0]) * n.y +
                            cross(columns[0], columns[1]) * n.z;
        return determinant() < 0 ? turned * -1 : turned;
    }
};

Place operator*(const Place& outer, const Place& inner) {
    return {{outer.turn(inner.columns[0]), outer.turn(inner.columns[1]), outer.turn(inner.columns[2])},
            outer.point(inner.origin)};
}

// The numbers of a key that must be so many; those of `otherwise` where it is absent.
template <size_t n>
std::array<double, n> numbers(const json& node, const char* key, std::array<double, n> otherwise) {
    const auto found = node.find(key);
    if (found == node.end()) return otherwise;
    if (!found->is_array() || found->size() != n) wrong(fmt::format("{} of a node has not {} numbers", key, n));
    for (size_t i = 0; i < n; ++i) {
        if (!(*found)[i].is_number()) wrong(fmt::format("{} of a node holds something else than numbers", key));
        otherwise[i] = (*found)[i];
        if (!(std::abs(otherwise[i]) <= coordinate_max)) wrong(fmt::format("{} of a node is beyond any place", key));
    }
    return otherwise;
}

Place place_of(const json& node) {
    if (node.contains("matrix")) {
        const auto m = numbers<16>(node, "matrix", {});
        if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1) wrong("the matrix of a node is a projection");
        return {{Vec3{m[0], m[1], m[2]}, Vec3{m[4], m[5], m[6]}, Vec3{m[8], m[9], m[10]}}, {m[12], m[13], m[14]}};
    }
    const auto t = numbers<3>(node, "translation", {0, 0, 0}), s = numbers<3>(node, "scale", {1, 1, 1});
    auto [x, y, z, w] = numbers<4>(node, "rotation", {0, 0, 0, 1});
    const double size = std::sqrt(x * x + y * y + z * z + w * w);
    if (!(std::abs(size - 1) < 0.01)) wrong("the rotation of a node is no unit quaternion");
    x /= size, y /= size, z /= size, w /= size;
    return {{Vec3{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)} * s[0],
             Vec3{2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)} * s[1],
             Vec3{2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)} * s[2]},
            {t[0], t[1], t[2]}};
}

// Extensions that files may require and that do not change where surfaces are.
bool is_harmless(const std::string& extension) {
    for (const char* begin : {"KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp",
                              "KHR_mesh_quantization", "KHR_animation_", "KHR_node_visibility"})
        if (extension.starts_with(begin)) return true;
    return false;
}

class GltfReader {
  public:
    GltfReader(const std::string& path, const GltfBuffers& buffers) : buffers_(buffers), json_(buffers.root()) {
        mesh_.path = path;
    }

    PolygonMesh read() {
        const std::string version = json_.at("asset").at("version");
        if (!version.starts_with("2.")) wrong("it is of version " + version + ", and 2 is read");
        for (const json& extension : json_.value("extensionsRequired", json::array()))
            if (!is_harmless(extension))
                wrong("it needs the extension " + extension.get<std::string>() +
                      ", which is not read: export it without");
        visited_.assign(list("nodes").size(), false);
        for (const uint64_t root : roots()) visit(root);
        note_unused();
        return std::move(mesh_);
    }

  private:
    const json& list(const char* name) const {
        static const json none = json::array();
        const auto found = json_.find(name);
        return found != json_.end() && found->is_array() ? *found : none;
    }

    const json& entry(const char* name, uint64_t index) const {
        if (index >= list(name).size()) wrong(fmt::format("there is no {} of {}", index, name));
        return list(name)[index];
    }

    static std::vector<uint64_t> indices(const json& object, const char* key) {
        std::vector<uint64_t> found;
        for (const json& index : object.value(key, json::array())) {
            if (!index.is_number_unsigned()) wrong(fmt::format("{} are no whole numbers", key));
            found.push_back(index);
        }
        return found;
    }

    // The nodes of the scene that is shown; of a file without scenes, those that are nobody's child.
    std::vector<uint64_t> roots() {
        const size_t scenes = list("scenes").size();
        if (scenes > 1 && !json_.contains("scene"))
            mesh_.notes.push_back(fmt::format("the first of its {} scenes is read", scenes));
        else if (scenes > 1)
            mesh_.notes.push_back(fmt::format("scene {} of its {} is read", gltf_whole(json_, "scene", 0), scenes));
        if (scenes > 0) return indices(entry("scenes", gltf_whole(json_, "scene", 0)), "nodes");
        std::vector<bool> is_child(list("nodes").size(), false);
        for (const json& node : list("nodes"))
            for (const uint64_t child : indices(node, "children"))
                if (child < is_child.size()) is_child[child] = true;
        std::vector<uint64_t> found;
        for (size_t i = 0; i < is_child.size(); ++i)
            if (!is_child[i]) found.push_back(i);
        return found;
    }

    // A node and all below it. Each comes once: a file that says otherwise has no tree.
    void visit(uint64_t root) {
        std::vector<std::pair<uint64_t, Place>> waiting = {{root, {}}};
        while (!waiting.empty()) {
            const auto [index, above] = waiting.back();
            waiting.pop_back();
            const json& node = entry("nodes", index);
            if (visited_[index]) wrong(fmt::format("node {} stands twice in the tree", index));
            visited_[index] = true;
            const Place place = above * place_of(node);
            if (node.contains("mesh")) add_mesh(node, place);
            skins_ += node.contains("skin");
            for (const uint64_t child : indices(node, "children")) waiting.emplace_back(child, place);
        }
    }

    void add_mesh(const json& node, const Place& place) {
        const uint64_t index = gltf_whole(node, "mesh", 0);
        const json& mesh = entry("meshes", index);
        const std::string name = node.value("name", mesh.value("name", fmt::format("mesh {}", index)));
        const auto [group, is_new] = groups_.try_emplace(name, uint32_t(mesh_.groups.size()));
        if (is_new) mesh_.groups.push_back(name);
        for (const json& primitive : mesh.at("primitives")) add_primitive(primitive, place, group->second);
    }

    void add_primitive(const json& primitive, const Place& place, uint32_t group) {
        const uint64_t mode = gltf_whole(primitive, "mode", 4);
        morphs_ += primitive.contains("targets");
        const json& attributes = primitive.at("attributes");
        if (mode < 4 || mode > 6 || !attributes.contains("POSITION")) {
            ++without_faces_;
            return;
        }
        const uint32_t first = uint32_t(mesh_.positions.size());
        const size_t added = add_vertices(attributes, place);
        std::vector<double> corners;
        if (primitive.contains("indices")) {
            corners = buffers_.read(gltf_whole(primitive, "indices", 0), 1);
        } else {
            for (size_t i = 0; i < added; ++i) corners.push_back(double(i));
        }
        spend(corners.size());
        const bool has_normals = attributes.contains("NORMAL"), mirrored = place.determinant() < 0;
        const auto corner = [&](size_t i) {
            if (!(corners[i] >= 0 && corners[i] < double(added)) || corners[i] != std::floor(corners[i]))
                wrong(fmt::format("an index names vertex {} of {}", corners[i], added));
            const uint32_t at = first + uint32_t(corners[i]);
            mesh_.corners.push_back({at, has_normals ? at : PolygonMesh::none});
        };
        if (mode == 4 && corners.size() % 3 != 0) wrong("a list of triangles has a part of one");
        const size_t step = mode == 4 ? 3 : 1;
        for (size_t i = 0; i + 2 < corners.size(); i += step) {
            const uint32_t number = uint32_t(mesh_.polygons.size());
            mesh_.polygons.push_back({uint32_t(mesh_.corners.size()), 3, group, number});
            const bool flipped = mirrored != (mode == 5 && i % 2 == 1);
            corner(mode == 6 ? 0 : i);
            corner(flipped ? i + 2 : i + 1);
            corner(flipped ? i + 1 : i + 2);
        }
    }

    // Positions, and a normal each where the file has one; colours once any part has them. How many there were.
    size_t add_vertices(const json& attributes, const Place& place) {
        const std::vector<double> positions = buffers_.read(gltf_whole(attributes, "POSITION", 0), 3);
        const size_t count = positions.size() / 3, first = mesh_.positions.size();
        spend(count);
        for (size_t i = 0; i < count; ++i) {
            const Vec3 p = place.point({positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]});
            if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= coordinate_max))
                wrong("its nodes move a vertex beyond any place");
            mesh_.positions.push_back(p);
        }
        mesh_.normals.resize(first + count);
        if (attributes.contains("NORMAL")) {
            const std::vector<double> normals = buffers_.read(gltf_whole(attributes, "NORMAL", 0), 3);
            if (normals.size() != positions.size()) wrong("a part has not as many normals as vertices");
            for (size_t i = 0; i < count; ++i)
                mesh_.normals[first + i] = place.turn_normal({normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]});
        }
        if (attributes.contains("COLOR_0")) add_colors(gltf_whole(attributes, "COLOR_0", 0), first, count);
        if (!mesh_.colors.empty()) mesh_.colors.resize(first + count);
        return count;
    }

    void add_colors(uint64_t accessor, size_t first, size_t count) {
        const bool has_alpha = entry("accessors", accessor).at("type") == "VEC4";
        const size_t width = has_alpha ? 4 : 3;
        const std::vector<double> colors = buffers_.read(accessor, int(width));
        if (colors.size() != width * count) wrong("a part has not as many colours as vertices");
        mesh_.colors.resize(first + count);
        for (size_t i = 0; i < count; ++i)
            mesh_.colors[first + i] = {float(colors[width * i]), float(colors[width * i + 1]),
                                       float(colors[width * i + 2])};
    }

    // Parts and nodes may share data, so that a small file can say a mesh of any size.
    void spend(size_t entries) {
        spent_ += entries;
        if (spent_ > std::max<uint64_t>(1'000'000, 4 * buffers_.bytes()))
            wrong("it repeats its data to more vertices and corners than four for each of its bytes");
    }

    void note_unused() {
        const auto note = [&](size_t count, const char* what) {
            if (count > 0) mesh_.notes.push_back(fmt::format("not used: {} {}", count, what));
        };
        note(list("materials").size(), "materials: name them by group in the scene");
        note(list("textures").size(), "textures");
        note(list("animations").size(), "animations");
        note(list("cameras").size(), "cameras");
        note(morphs_, "parts' morph targets");
        note(skins_, "skins: what they deform stands as it was modelled");
        note(without_faces_, "parts without faces (points, lines)");
    }

    const GltfBuffers& buffers_;
    const json& json_;
    PolygonMesh mesh_;
    std::map<std::string, uint32_t> groups_;
    std::vector<bool> visited_;
    uint64_t spent_ = 0;
    size_t skins_ = 0, morphs_ = 0, without_faces_ = 0;
};

}  // namespace

Result<PolygonMesh> parse_gltf(const std::string& path, const std::string& bytes) {
    const auto buffers = GltfBuffers::open(path, bytes);
    if (!buffers) return buffers.error();
    try {
        PolygonMesh mesh = GltfReader(path, *buffers).read();
        if (const Status status = check_corners(mesh); !status) return status.error();
        return mesh;
    } catch (const std::exception& e) {
        return fail(fmt::format("'{}' cannot be read as glTF: {}", path, e.what()));
    }
}

}  // namespace ols
