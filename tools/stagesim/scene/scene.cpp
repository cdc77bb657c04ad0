// SPDX-License-Identifier: MIT
// Scenes from TOML.
#include "scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stage/toml_section.hpp"

namespace ols {

namespace {

constexpr size_t materials_max = 1000, objects_max = 1000, keyframes_max = 100'000, expressions_max = 1000;
constexpr double latest_us = 1e12;     // of a keyframe: eleven days
constexpr double placing_max_m = 1e9;  // meshes may lie that far off in their files, and be moved back
constexpr int64_t whole_in_double_max = 9'000'000'000'000'000;

Vec3 read_vector(TomlSection& section, const std::string& key, Vec3 otherwise, double most) {
    std::array<double, 3> v = {otherwise.x, otherwise.y, otherwise.z};
    section.read(key, v, -most, most);
    return {v[0], v[1], v[2]};
}

double read_number(TomlSection& section, const std::string& key, double otherwise, double low, double high) {
    section.read(key, otherwise, low, high);
    return otherwise;
}

int64_t read_whole(TomlSection& section, const std::string& key, int64_t otherwise, int64_t low, int64_t high) {
    section.read(key, otherwise, low, high);
    return otherwise;
}

Vec3 read_axis(TomlSection& section, const std::string& key, Vec3 otherwise) {
    std::array<double, 3> v = {otherwise.x, otherwise.y, otherwise.z};
    section.read_direction(key, v);
    return {v[0], v[1], v[2]};
}

Material read_material(TomlSection& section) {
    Material material;
    section.read("name", material.name);
    if (material.name.empty()) section.reject("name", "is missing: objects name their material");
    section.read_choice<MaterialType>("type", material.type,
                                      {{"diffuse", MaterialType::diffuse},
                                       {"skin", MaterialType::skin},
                                       {"eye", MaterialType::eye},
                                       {"hair", MaterialType::hair}});
    std::array<double, 3> albedo = {0.5, 0.5, 0.5};
    section.read("albedo", albedo, 0, 1);
    material.albedo = {float(albedo[0]), float(albedo[1]), float(albedo[2])};
    material.roughness = float(read_number(section, "roughness", material.roughness, 0.03, 1));
    material.f0 = float(read_number(section, "f0", 0, 0, 1));
    return material;
}

// How an object's mesh is scaled and turned, and its expressions with it.
MeshPlacement read_placement(TomlSection& section, Vec3 position) {
    const double scale = read_number(section, "scale", 1, 1e-6, 1e6);
    const Vec3 axis = read_axis(section, "rotation_axis", {0, 1, 0});
    return {scale, rotation_about(axis, read_number(section, "rotation_deg", 0, -360, 360)), position};
}

// Vertex colours are what an artist painted, unless the scene says that they are masks.
void read_masks(TomlSection& section, Mesh& mesh) {
    bool are_masks = false;
    section.read_choice<bool>("masks", are_masks, {{"none", false}, {"vertex_colors", true}});
    if (!are_masks && mesh.has_colors) {
        mesh.notes.push_back(
            "not used: its vertex colours (masks = \"vertex_colors\" makes them the masks of skin and eyes)");
        mesh.masks.assign(mesh.masks.size(), {});
    }
    if (!are_masks) return;
    if (!mesh.has_colors) return section.reject("masks", "names vertex colours, and the mesh has none");
    for (const Float3& m : mesh.masks)
        if (!(std::min({m.x, m.y, m.z}) >= 0 && std::max({m.x, m.y, m.z}) <= 1))
            return section.reject("masks",
                                  fmt::format("names vertex colours, and one is ({}, {}, {}): masks lie from 0 "
                                              "to 1",
                                              m.x, m.y, m.z));
}

// A mesh is placed once, at reading; motion comes on top of it.
std::optional<Mesh> read_placed_mesh(TomlSection& section, Vec3 position) {
    std::string file;
    section.read("mesh", file);
    const MeshPlacement placement = read_placement(section, position);
    auto mesh = read_mesh(file.empty() ? file : section.resolve_path(file), placement);
    if (!mesh) {
        section.reject("mesh", "cannot be used: " + mesh.error().message);
        return std::nullopt;
    }
    read_masks(section, *mesh);
    for (std::string& note : mesh->notes) note = fmt::format("mesh '{}': {}", file, note);
    return std::move(*mesh);
}

Mesh read_quad(TomlSection quad, Vec3 position) {
    const Vec3 normal = read_axis(quad, "normal", {0, 0, 1});
    Vec3 up = read_axis(quad, "up", {0, 1, 0});
    if (length(cross(up, normal)) < 1e-6 * length(up) * length(normal)) {
        quad.reject("up", "is parallel to normal");
        up = {normal.y, normal.z, normal.x};
    }
    const double width = read_number(quad, "width_m", 1, 1e-4, 100),
                 height = read_number(quad, "height_m", 1, 1e-4, 100);
    return make_quad(position, normal, up, width, height);
}

void read_motion(TomlSection& section, Object& object) {
    for (TomlSection& entry : section.sections("motion", keyframes_max)) {
        Keyframe keyframe;
        entry.read("time_us", keyframe.time_us, 0, latest_us);
        keyframe.translation_m = read_vector(entry, "translation_m", {}, reach_max_m);
        const Vec3 axis = read_axis(entry, "axis", {0, 1, 0});
        keyframe.rotation = rotation_about(axis, read_number(entry, "angle_deg", 0, -180, 180));
        if (!object.motion.empty() && keyframe.time_us <= object.motion.back().time_us)
            entry.reject("time_us", "must be later than the keyframe before");
        object.motion.push_back(keyframe);
    }
}

// Targets follow the mesh: they are scaled and turned with it.
void read_expressions(TomlSection& section, Object& object) {
    std::vector<TomlSection> entries = section.sections("expression", expressions_max);
    if (entries.empty()) return;
    const MeshPlacement placement = read_placement(section, {});
    for (TomlSection& entry : entries) {
        const Mesh* mesh = std::get_if<Mesh>(&object.shape);
        std::string file;
        entry.read("target", file);
        if (!mesh || mesh->file_vertices.empty() || mesh->has_own_normals) {
            entry.reject("target", "needs a mesh whose file has no normals (vn), since they change with the face");
            return;
        }
        auto target = read_target(file.empty() ? file : entry.resolve_path(file), *mesh, placement);
        if (!target) {
            entry.reject("target", "cannot be used: " + target.error().message);
            return;
        }
        Expression expression{file, std::move(*target), {}, read_number(entry, "period_us", 0, 0, latest_us)};
        for (TomlSection& key : entry.sections("key", keyframes_max)) {
            expression.keys.push_back(
                {read_number(key, "time_us", 0, 0, latest_us), read_number(key, "weight", 0, -2, 2)});
            const size_t last = expression.keys.size() - 1;
            if (last > 0 && expression.keys[last].time_us <= expression.keys[last - 1].time_us)
                key.reject("time_us", "must be later than the key before");
        }
        object.expressions.push_back(std::move(expression));
    }
}

uint32_t find_material(const Scene& scene, TomlSection& section, const std::string& key, const std::string& name) {
    for (size_t i = 0; i < scene.materials.size(); ++i)
        if (scene.materials[i].name == name) return uint32_t(i);
    section.reject(key, fmt::format("is '{}', but no [[material]] has that name", name));
    return 0;
}

// Every group of the shape gets the object's material, or its own from the table `materials`.
void read_materials_of(const Scene& scene, TomlSection& section, Object& object) {
    std::vector<std::string> groups = {object.name};
    if (const Mesh* mesh = std::get_if<Mesh>(&object.shape)) groups = mesh->groups;
    std::string everywhere;
    section.read("material", everywhere);
    TomlSection by_group = section.section("materials");
    for (const std::string& group : groups) {
        std::string own;
        by_group.read(group, own);
        object.material_of_group.push_back(own.empty() ? find_material(scene, section, "material", everywhere)
                                                       : find_material(scene, by_group, group, own));
    }
}

void read_object(Scene& scene, TomlSection& section) {
    Object object;
    object.name = fmt::format("object {}", scene.objects.size() + 1);
    section.read("name", object.name);
    if (section.has("mesh") + section.has("sphere") + section.has("quad") != 1)
        return section.reject("mesh", "an object is one of mesh, sphere and quad");
    const Vec3 position = read_vector(section, "position_m", {}, section.has("mesh") ? placing_max_m : reach_max_m);
    if (section.has("mesh")) {
        auto mesh = read_placed_mesh(section, position);
        if (!mesh) return;
        scene.notes.insert(scene.notes.end(), mesh->notes.begin(), mesh->notes.end());
        object.shape = std::move(*mesh);
    } else if (section.has("sphere")) {
        TomlSection sphere = section.section("sphere");
        object.shape = Sphere{to_float3(position), float(read_number(sphere, "radius_m", 0.1, 1e-4, 10))};
        object.is_convex = true;
    } else {
        object.shape = read_quad(section.section("quad"), position);
        object.is_convex = true;
    }
    read_materials_of(scene, section, object);
    read_motion(section, object);
    read_expressions(section, object);
    scene.objects.push_back(std::move(object));
}

void read_board(Scene& scene, TomlSection section) {
    Board board;
    board.center_m = read_vector(section, "center_m", board.center_m, reach_max_m);
    section.read("width_m", board.width_m, 0.01, 10);
    section.read("height_m", board.height_m, 0.01, 10);
    board.albedo = float(read_number(section, "albedo", board.albedo, 0, 1));
    add_board(scene, board);
}

}  // namespace

Placement placement_at(const Object& object, double time_us) {
    Placement placement{pose_at(object.motion, time_us), {}};
    for (const Expression& expression : object.expressions) placement.weights.push_back(weight_at(expression, time_us));
    return placement;
}

bool moves(const Object& object) {
    return moves(object.motion) || std::any_of(object.expressions.begin(), object.expressions.end(),
                                               [](const Expression& e) { return moves(e); });
}

void add_board(Scene& scene, const Board& board) {
    Material grey;
    grey.name = "matte board";
    grey.albedo = {board.albedo, board.albedo, board.albedo};
    scene.materials.push_back(grey);
    Object object;
    object.name = "matte board";
    object.shape = make_quad(board.center_m, {0, 0, 1}, {0, 1, 0}, board.width_m, board.height_m);
    object.material_of_group = {uint32_t(scene.materials.size() - 1)};
    object.is_board = object.is_convex = true;
    scene.objects.push_back(std::move(object));
    scene.board = board;
}

Result<Scene> read_scene(const std::string& path) {
    auto file = TomlSection::open(path);
    if (!file) return file.error();
    Scene scene;
    scene.path = path;
    file->read("samples", scene.samples, 1, 256);
    const int side = int(std::lround(std::sqrt(scene.samples)));
    if (side * side != scene.samples) file->reject("samples", "must be a square number: 1, 4, 9, 16, ...");
    file->read("merge_samples", scene.merges_samples);
    scene.texture_step_m = float(read_number(*file, "texture_step_mm", 0, 0, 1000) * 1e-3);
    file->read("shadow_step_px", scene.shadow_step_px, 1, 5);
    if (scene.shadow_step_px % 2 == 0) file->reject("shadow_step_px", "must be 1 (exact), 3 or 5");
    scene.seed = uint64_t(read_whole(*file, "seed", 1, 0, whole_in_double_max));
    TomlSection clock = file->section("clock");
    scene.clock.offset_ns = read_whole(clock, "offset_ns", scene.clock.offset_ns, 0, whole_in_double_max);
    clock.read("drift_ppm", scene.clock.drift_ppm, -1000, 1000);
    for (TomlSection& material : file->sections("material", materials_max))
        scene.materials.push_back(read_material(material));
    for (TomlSection& object : file->sections("object", objects_max)) read_object(scene, object);
    if (file->has("board")) read_board(scene, file->section("board"));
    if (const Status status = file->finish(); !status) return status.error();
    if (scene.objects.empty()) return fail("'" + path + "': the scene is empty: add an [[object]] or a [board]");
    return scene;
}

}  // namespace ols
