// SPDX-License-Identifier: MIT
// The scene: what stands in the stage, what it is made of and how it moves.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "result.hpp"
#include "scene/expression.hpp"
#include "scene/mesh.hpp"
#include "scene/motion.hpp"
#include "scene/vector.hpp"

namespace ols {

enum class MaterialType {
    diffuse,  // one albedo
    skin,     // texture.hpp, with the mesh's masks for lips, hair and flush
    eye,      // texture.hpp, with the mesh's mask for the angle from the eye's axis
    hair,     // texture.hpp, strands along the object's y
};

struct Material {
    std::string name;
    MaterialType type = MaterialType::diffuse;
    Float3 albedo{0.5f, 0.5f, 0.5f};  // linear, of light reflected diffusely
    float roughness = 0.4f;           // GGX alpha is its square
    float f0 = 0;                     // reflectance at normal incidence; 0: no specular part
};

struct Sphere {
    Float3 center_m;
    float radius_m = 0.1f;
};

struct Object {
    std::string name;
    std::variant<Mesh, Sphere> shape;
    std::vector<uint32_t> material_of_group;  // a sphere has one group
    std::vector<Keyframe> motion;
    std::vector<Expression> expressions;  // of a mesh
    bool is_board = false;                // the matte board: lit by the matte lamps
    bool is_convex = false;               // casts no shadow on itself
};

// Where an object is at a moment, and how its face is set.
struct Placement {
    Pose pose;
    std::vector<double> weights;  // one an expression

    bool operator==(const Placement&) const = default;
};

Placement placement_at(const Object& object, double time_us);

bool moves(const Object& object);

struct Board {
    Vec3 center_m{0, 0, -0.5};
    double width_m = 0.6, height_m = 0.4;  // Wenger 3.2
    float albedo = 0.32f;                  // 32 % grey
};

// How the camera's clock runs beside the board's: camera_ns = offset_ns + tick * 8 ns * (1 + drift_ppm * 1e-6).
struct CameraClock {
    int64_t offset_ns = 1'000'000'000;
    double drift_ppm = 0;
};

struct Scene {
    std::string path;
    std::vector<Material> materials;
    std::vector<Object> objects;  // the board, if there is one, is the last
    std::optional<Board> board;
    int samples = 4;  // primary samples a pixel, a square number
    // Knobs for speed, approximations all: samples of a pixel that meet one smooth surface are shaded as one, and
    // shadows are found on a lattice of pixels (effects/shadows.hpp), and looks of meshes on a lattice of their triangles
    // (baked_looks.hpp; 0: exact).
    bool merges_samples = false;
    int shadow_step_px = 1;
    float texture_step_m = 0;
    uint64_t seed = 1;  // of the cameras' noise
    CameraClock clock;
    std::vector<std::string> notes;  // what of the files is not used, and what was understood in its place
};

// Reads a scene (the format is described in tools/stagesim/scenes/README.md) and the meshes it names, relative to the
// file. Unknown keys, values out of range and missing materials are errors that name file, line and key.
Result<Scene> read_scene(const std::string& path);

// Adds the matte board as the last object, with its own material.
void add_board(Scene& scene, const Board& board);

}  // namespace ols
