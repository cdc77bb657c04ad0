// SPDX-License-Identifier: MIT
// Scenes from TOML.
#include "scene.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "toml_keys.hpp"

namespace ols {

namespace {

class SceneReader {
  public:
    explicit SceneReader(const std::string& path) { scene_.path = path; }

    Result<Scene> read(const toml::table& root) {
        TomlKeys keys(root, "scene", scene_.path, error_);
        scene_.samples = int(keys.number("samples", 4, 1, 256));
        const int side = int(std::lround(std::sqrt(scene_.samples)));
        if (side * side != scene_.samples) keys.complain("samples", "must be a square number: 1, 4, 9, 16, ...");
        scene_.seed = uint64_t(keys.number("seed", 1, 0, 9e15));
        if (const toml::table* clock = keys.table("clock")) read_clock(*clock);
        if (const toml::array* materials = keys.tables("material"))
            for (const toml::node& node : *materials) read_material(*node.as_table());
        if (const toml::array* objects = keys.tables("object"))
            for (const toml::node& node : *objects) read_object(*node.as_table());
        if (const toml::table* board = keys.table("board")) read_board(*board);
        keys.reject_unknown();
        if (scene_.objects.empty()) keys.complain("object", "the scene is empty: add an [[object]] or a [board]");
        if (!error_.empty()) return fail(error_);
        return std::move(scene_);
    }

  private:
    TomlKeys keys_of(const toml::table& table, const std::string& what) {
        return TomlKeys(table, what, scene_.path, error_);
    }

    void read_clock(const toml::table& table) {
        TomlKeys keys = keys_of(table, "clock");
        scene_.clock.offset_ns = int64_t(keys.number("offset_ns", double(scene_.clock.offset_ns), 0, 9e15));
        scene_.clock.drift_ppm = keys.number("drift_ppm", 0, -1000, 1000);
        keys.reject_unknown();
    }

    void read_board(const toml::table& table) {
        TomlKeys keys = keys_of(table, "board");
        Board board;
        board.center_m = keys.triple("center_m", board.center_m);
        board.width_m = keys.number("width_m", board.width_m, 0.01, 10);
        board.height_m = keys.number("height_m", board.height_m, 0.01, 10);
        board.albedo = float(keys.number("albedo", board.albedo, 0, 1));
        keys.reject_unknown();
        add_board(scene_, board);
    }

    void read_material(const toml::table& table) {
        TomlKeys keys = keys_of(table, "material");
        Material material;
        material.name = keys.text("name", "");
        if (material.name.empty()) keys.complain("name", "every material needs a name");
        const std::string type = keys.text("type", "diffuse");
        if (type == "skin")
            material.type = MaterialType::skin;
        else if (type == "eye")
            material.type = MaterialType::eye;
        else if (type != "diffuse")
            keys.complain("type", "must be diffuse, skin or eye");
        const Vec3 albedo = keys.triple("albedo", {0.5, 0.5, 0.5});
        for (const double a : {albedo.x, albedo.y, albedo.z})
            if (a < 0 || a > 1) keys.complain("albedo", "must lie from 0 to 1");
        material.albedo = to_float3(albedo);
        material.roughness = float(keys.number("roughness", material.roughness, 0.03, 1));
        material.f0 = float(keys.number("f0", 0, 0, 1));
        keys.reject_unknown();
        scene_.materials.push_back(std::move(material));
    }

    uint32_t find_material(TomlKeys& keys, const std::string& key, const std::string& name) {
        for (size_t i = 0; i < scene_.materials.size(); ++i)
            if (scene_.materials[i].name == name) return uint32_t(i);
        keys.complain(key, fmt::format("there is no material '{}': add a [[material]] of that name", name));
        return 0;
    }

    void read_object(const toml::table& table) {
        TomlKeys keys = keys_of(table, "object");
        Object object;
        object.name = keys.text("name", fmt::format("object {}", scene_.objects.size() + 1));
        const int shapes = int(keys.has("mesh")) + int(keys.has("sphere")) + int(keys.has("quad"));
        if (shapes != 1) keys.complain("mesh", "an object is one of mesh, sphere and quad");
        const Vec3 position = keys.triple("position_m", {});
        if (keys.has("mesh")) read_mesh(keys, position, object);
        if (const toml::table* sphere = keys.table("sphere")) {
            TomlKeys sphere_keys = keys_of(*sphere, "object.sphere");
            object.shape = Sphere{to_float3(position), float(sphere_keys.number("radius_m", 0.1, 1e-4, 10))};
            object.is_convex = true;
            sphere_keys.reject_unknown();
        }
        if (const toml::table* quad = keys.table("quad")) {
            TomlKeys quad_keys = keys_of(*quad, "object.quad");
            const Vec3 normal = quad_keys.triple("normal", {0, 0, 1}), up = quad_keys.triple("up", {0, 1, 0});
            if (length(cross(up, normal)) < 1e-6) quad_keys.complain("up", "must not be parallel to normal");
            object.shape = make_quad(position, normal, up, quad_keys.number("width_m", 1, 1e-4, 100),
                                     quad_keys.number("height_m", 1, 1e-4, 100));
            object.is_convex = true;
            quad_keys.reject_unknown();
        }
        read_materials_of(keys, object);
        if (const toml::array* motion = keys.tables("motion")) read_motion(*motion, object);
        keys.reject_unknown();
        scene_.objects.push_back(std::move(object));
    }

    void read_mesh(TomlKeys& keys, Vec3 position, Object& object) {
        const auto folder = std::filesystem::path(scene_.path).parent_path();
        const auto file = (folder / keys.text("mesh", "")).lexically_normal();
        const double scale = keys.number("scale", 1, 1e-6, 1e6);
        const Vec3 axis = keys.triple("rotation_axis", {0, 1, 0});
        const double angle = keys.number("rotation_deg", 0, -360, 360);
        if (length(axis) < 1e-9) keys.complain("rotation_axis", "must not be zero");
        if (!error_.empty()) return;
        auto mesh = read_obj(file);
        if (!mesh) {
            error_ = mesh.error().message;
            return;
        }
        const Pose placement{rotation_about(axis, angle), position};
        for (Float3& p : mesh->positions) p = placement.point(p * float(scale));
        for (Float3& n : mesh->normals) n = placement.turn(n);
        object.shape = std::move(*mesh);
    }

    void read_materials_of(TomlKeys& keys, Object& object) {
        const std::string everywhere = keys.text("material", "");
        const toml::table* by_group = keys.table("materials");
        std::vector<std::string> groups = {object.name};
        if (const Mesh* mesh = std::get_if<Mesh>(&object.shape)) groups = mesh->groups;
        for (const std::string& group : groups) {
            const auto own = by_group ? (*by_group)[group].value<std::string>() : std::nullopt;
            object.material_of_group.push_back(
                find_material(keys, own ? "materials" : "material", own ? *own : everywhere));
        }
        if (!by_group) return;
        for (const auto& [group, name] : *by_group)
            if (std::find(groups.begin(), groups.end(), group.str()) == groups.end())
                keys.complain("materials", fmt::format("the mesh has no group '{}'", std::string(group.str())));
    }

    void read_motion(const toml::array& motion, Object& object) {
        for (const toml::node& node : motion) {
            TomlKeys keys = keys_of(*node.as_table(), "object.motion");
            Keyframe keyframe;
            keyframe.time_us = keys.number("time_us", 0, 0, 1e15);
            keyframe.translation_m = keys.triple("translation_m", {});
            const Vec3 axis = keys.triple("axis", {0, 1, 0});
            if (length(axis) < 1e-9) keys.complain("axis", "must not be zero");
            keyframe.rotation = rotation_about(axis, keys.number("angle_deg", 0, -180, 180));
            if (!object.motion.empty() && keyframe.time_us <= object.motion.back().time_us)
                keys.complain("time_us", "keyframes must ascend in time");
            keys.reject_unknown();
            object.motion.push_back(keyframe);
        }
    }

    Scene scene_;
    std::string error_;
};

}  // namespace

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
    if (!std::filesystem::is_regular_file(path)) return fail("cannot open scene '" + path + "': check the path");
    try {
        return SceneReader(path).read(toml::parse_file(path));
    } catch (const toml::parse_error& e) {
        return fail(fmt::format("{}:{}: {}", path, e.source().begin.line, e.description()));
    }
}

}  // namespace ols
