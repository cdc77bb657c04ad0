// SPDX-License-Identifier: MIT
// Thousands of damaged mesh, scene and stage files from a fixed seed: each is read into something whole, or refused by its name.
// links: ols_stagesim
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>

#include "scene/scene.hpp"
#include "stage/stage.hpp"

using namespace ols;

namespace {

const std::string square =
    "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvn 0 0 1\ng a\nf 1//1 2//1 3//1 4//1\n";
const std::string ply =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
const std::string gltf =
    R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":[2,3,1]}],)"
    R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[{"bufferView":0,)"
    R"("componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],)"
    R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],"buffers":[{"byteLength":60,)"
    R"("uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA"}]})";
const std::string scene =
    "samples = 4\nseed = 3\n[clock]\noffset_ns = 5\ndrift_ppm = 1.5\n[[material]]\nname = \"m\"\nalbedo = [0.1, 0.2, "
    "0.3]\n"
    "f0 = 0.04\n[[object]]\nmaterial = \"m\"\nsphere = { radius_m = 0.1 }\nposition_m = [0, 0.1, "
    "0]\n[[object.motion]]\n"
    "time_us = 5\ntranslation_m = [0, 1, 0]\n[[object]]\nmaterial = \"m\"\nquad = { normal = [0, 0, 1], width_m = 2 "
    "}\n";
const std::string stage =
    "[lamps]\nradius_m = 1.5\nbeam_exponent = 1.2\n[[lamps.matte]]\nposition_m = [0, 1, -0.5]\n[chain]\nbits = "
    "200\n[[camera]]\n"
    "width = 64\nheight = 48\ncfa = \"rggb\"\nposition_m = [0, 0, 1.6]\nlook_at_m = [0, 0, 0]\nup = [0, 1, 0]\nwhite = "
    "4095\n";

// One to four places of a text changed, taken out, doubled or filled with what readers stumble over.
std::string damaged(std::string text, std::mt19937& random) {
    static const std::vector<std::string> stumbles = {
        "99999999999", "-1", "0", "1e308", "nan", std::string(1, '\0'), "[", "{", "\"", "\xff", "\n", "e", "."};
    const auto below = [&](size_t n) { return size_t(random() % std::max<size_t>(1, n)); };
    for (size_t changes = 1 + below(4); changes > 0; --changes) {
        const size_t at = below(text.size());
        switch (below(4)) {
            case 0:
                if (!text.empty()) text[at] = char(below(256));
                break;
            case 1: text.erase(at, 1 + below(12)); break;
            case 2: text.insert(at, text.substr(at, 1 + below(30))); break;
            default: text.insert(at, stumbles[below(stumbles.size())]);
        }
    }
    return text;
}

bool is_whole(const Mesh& mesh) {
    for (const Triangle& t : mesh.triangles)
        for (const uint32_t v : t.vertex)
            if (v >= mesh.positions.size() || t.group >= mesh.groups.size()) return false;
    for (size_t v = 0; v < mesh.positions.size(); ++v)
        if (!(length(mesh.positions[v]) < 1001) || !(std::abs(length(mesh.normals[v]) - 1) < 1e-3)) return false;
    return !mesh.triangles.empty();
}

bool is_whole(const Scene& made) {
    for (const Object& object : made.objects)
        if (object.material_of_group.empty()) return false;
    for (const Material& m : made.materials)
        if (!(m.albedo.x >= 0 && m.albedo.x <= 1 && m.f0 >= 0 && m.f0 <= 1)) return false;
    return made.samples >= 1 && (!made.objects.empty() || made.board);
}

bool is_whole(const StageConfig& made) {
    for (const CameraConfig& c : made.cameras) {
        const auto &p = c.position_m, &l = c.look_at_m;
        if (!(std::hypot(p[0] - l[0], p[1] - l[1], p[2] - l[2]) > 0 && c.black < c.white && c.width >= 8)) return false;
    }
    return made.lamp_count() > 0 && made.radius_m > 0;
}

class Mutations : public testing::Test {
  protected:
    Mutations() { std::filesystem::create_directories(folder_); }
    ~Mutations() override { std::filesystem::remove_all(folder_); }

    // Tries so many damaged files; what is read must be whole, what is refused must name the file.
    template <typename Read>
    void try_all(const std::string& name, const std::string& good, int count, const Read& read) {
        std::mt19937 random(7);
        int right = 0, refused = 0;
        const std::string path = folder_ / name;
        for (int i = 0; i < count; ++i) {
            const std::string text = damaged(good, random);
            std::ofstream(path, std::ios::binary) << text;
            const auto made = read(path);
            if (made)
                ASSERT_TRUE(is_whole(*made)) << text;
            else
                ASSERT_NE(made.error().message.find(name), std::string::npos) << made.error().message << " of\n"
                                                                              << text;
            ++(made ? right : refused);
        }
        fmt::print("{}: {} damaged files, {} read, {} refused\n", name, count, right, refused);
        EXPECT_GT(refused, count / 4);
    }

    const std::filesystem::path folder_ =
        std::filesystem::temp_directory_path() / ("mutations" + std::to_string(getpid()));
};

}  // namespace

TEST_F(Mutations, of_meshes_are_whole_or_refused) {
    const auto read = [](const std::string& path) { return read_mesh(path); };
    try_all("a.obj", square, 1500, read);
    try_all("a.ply", ply, 1500, read);
    try_all("a.gltf", gltf, 1500, read);
}

TEST_F(Mutations, of_binary_meshes_are_whole_or_refused) {
    const auto bytes = [](const auto& values) {
        return std::string(reinterpret_cast<const char*>(values.data()), sizeof(values));
    };
    const std::array<float, 12> places = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const std::array<int32_t, 4> corners = {0, 1, 2, 3};
    std::string binary = ply.substr(0, ply.find("0 0 0\n1"));
    binary.replace(binary.find("ascii"), 5, "binary_little_endian");
    const auto read = [](const std::string& path) { return read_mesh(path); };
    try_all("b.ply", binary + bytes(places) + '\4' + bytes(corners), 1500, read);
    std::string json = gltf.substr(0, gltf.find(",\n")),
                data = bytes(places) + bytes(std::array<uint16_t, 6>{0, 1, 2, 0, 2, 3});
    const size_t uri = json.find(",\"uri\"");
    json = json.substr(0, uri) + "}]}";
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::array<uint32_t, 5> head = {0x46546c67, 2, uint32_t(28 + json.size() + data.size()),
                                          uint32_t(json.size()), 0x4e4f534a};
    const std::array<uint32_t, 2> chunk = {uint32_t(data.size()), 0x004e4942};
    try_all("b.glb", bytes(head) + json + bytes(chunk) + data, 1500, read);
}

TEST_F(Mutations, of_scenes_and_stages_are_whole_or_refused) {
    try_all("scene.toml", scene, 1500, [](const std::string& path) { return read_scene(path); });
    try_all("stage.toml", stage, 1500, [](const std::string& path) { return read_stage(path); });
}
