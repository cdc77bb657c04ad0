// SPDX-License-Identifier: MIT
// PLY and glTF files, put together byte by byte: what is in them, where their nodes put it, and what each mistake is told.
// links: ols_stagesim
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "scene/mesh.hpp"
#include "scratch_folder.hpp"

using namespace ols;

namespace {

class MeshBinaries : public ScratchFolder {
  protected:
    std::string refusal(const std::string& name, const std::string& bytes) {
        const auto mesh = read_mesh(write(name, bytes));
        return mesh ? "was read" : mesh.error().message;
    }
};

bool contains(const std::string& text, const std::string& what) {
    return text.find(what) != text.npos;
}

double area(const Mesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const Float3 a = mesh.positions[t.vertex[0]];
        sum += 0.5 * cross(mesh.positions[t.vertex[1]] - a, mesh.positions[t.vertex[2]] - a).z;
    }
    return sum;
}

std::string notes(const Mesh& mesh) {
    std::string all;
    for (const std::string& note : mesh.notes) all += note + "\n";
    return all;
}

template <typename T>
std::string bytes_of(std::initializer_list<T> values, bool big = false) {
    std::string all;
    for (const T value : values) {
        std::string one(sizeof(T), '\0');
        std::memcpy(one.data(), &value, sizeof(T));
        if (big) std::reverse(one.begin(), one.end());
        all += one;
    }
    return all;
}

std::string ply_header(const std::string& format, const std::string& type, const std::string& more = "") {
    return "ply\nformat " + format + " 1.0\ncomment by hand\nelement vertex 4\nproperty " + type + " x\nproperty " +
           type + " y\nproperty " + type + " z\n" + more +
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
}

const std::string square_rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

// A square of 16-bit indices. `view` is the JSON of its first bufferView after its length, and so on.
struct Gltf {
    std::string node = "", top = "", primitive = "", accessor = "", buffer = "";
    std::string positions = bytes_of<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
    std::string indices = bytes_of<uint16_t>({0, 1, 2, 0, 2, 3});
    std::string roots = "0";

    std::string data() const { return positions + indices; }
    std::string json() const {
        return fmt::format(
            R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{}]}}],"nodes":[{{"mesh":0{}}}],)"
            R"("meshes":[{{"name":"card","primitives":[{{"attributes":{{"POSITION":0}},"indices":1{}}}]}}],)"
            R"("accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"{}}},)"
            R"({{"bufferView":1,"componentType":5123,"count":{},"type":"SCALAR"}}],)"
            R"("bufferViews":[{{"buffer":0,"byteLength":{}}},{{"buffer":0,"byteOffset":{},"byteLength":{}}}],)"
            R"("buffers":[{{"byteLength":{}{}}}]{}}})",
            roots, node, primitive, accessor, indices.size() / 2, positions.size(), positions.size(), indices.size(),
            data().size(), buffer, top);
    }
    std::string glb() const {
        std::string text = json(), binary = data();
        text.resize((text.size() + 3) / 4 * 4, ' ');
        binary.resize((binary.size() + 3) / 4 * 4, '\0');
        const auto words = [](std::initializer_list<uint32_t> values) { return bytes_of<uint32_t>(values); };
        return "glTF" + words({2, uint32_t(28 + text.size() + binary.size()), uint32_t(text.size()), 0x4e4f534a}) +
               text + words({uint32_t(binary.size()), 0x004e4942}) + binary;
    }
};

}  // namespace

TEST_F(MeshBinaries, ply_files_are_read_in_every_format_and_type) {
    const std::string face = std::string(1, '\4');
    const auto file = [&](const std::string& format, bool big, bool is_double) {
        const std::string header = ply_header(format, is_double ? "double" : "float");
        const std::string places = is_double ? bytes_of<double>({0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0}, big)
                                             : bytes_of<float>({0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0}, big);
        return header + places + face + bytes_of<int32_t>({0, 1, 2, 3}, big);
    };
    for (const bool big : {false, true})
        for (const bool is_double : {false, true}) {
            const auto mesh =
                read_mesh(write("m.ply", file(big ? "binary_big_endian" : "binary_little_endian", big, is_double)));
            ASSERT_TRUE(mesh) << mesh.error().message;
            EXPECT_NEAR(area(*mesh), 2, 1e-6);
        }
    std::string text = ply_header("ascii", "float32") + square_rows + "4 0 1 2 3\n";
    for (int ending = 0; ending < 2; ++ending) {
        const auto mesh = read_mesh(write("m.ply", text));
        ASSERT_TRUE(mesh) << mesh.error().message;
        EXPECT_NEAR(area(*mesh), 1, 1e-6);
        for (size_t at = 0; (at = text.find('\n', at)) != text.npos; at += 2) text.insert(at, "\r");
    }
}

TEST_F(MeshBinaries, ply_files_may_be_far_off_and_have_normals_and_colours) {
    const auto far = read_mesh(write("far.ply", ply_header("binary_little_endian", "double") +
                                                    bytes_of<double>({1e6, 1e6, 5, 1e6 + 0.01, 1e6, 5, 1e6 + 0.01,
                                                                      1e6 + 0.01, 5, 1e6, 1e6 + 0.01, 5}) +
                                                    '\4' + bytes_of<int32_t>({0, 1, 2, 3})),
                               {1, {1, 0, 0, 0}, {-1e6, -1e6, 0}});
    ASSERT_TRUE(far) << far.error().message;
    EXPECT_NEAR(area(*far), 1e-4, 1e-11);
    const std::string more =
        "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\nproperty float quality\n";
    const std::string rest = " 0 0.6 0.8 255 51 0 7\n";
    const auto rich = read_mesh(write("rich.ply", ply_header("ascii", "float", more) + "0 0 0" + rest + "1 0 0" + rest +
                                                      "1 1 0" + rest + "0 1 0 0 0 0 255 51 0 7\n4 0 1 2 3\n"));
    ASSERT_TRUE(rich) << rich.error().message;
    EXPECT_TRUE(rich->has_colors && rich->has_own_normals);
    for (const Float3 mask : rich->masks) EXPECT_NEAR(length(mask - Float3{1, 0.2f, 0}), 0, 1e-6);
    EXPECT_NEAR(length(rich->normals[0] - Float3{0, 0.6f, 0.8f}), 0, 1e-6);
    EXPECT_PRED2(contains, notes(*rich), "not used: quality of vertex");
    EXPECT_PRED2(contains, notes(*rich), "1 corners have a normal of no length");
}

TEST_F(MeshBinaries, a_ply_file_that_is_wrong_is_refused_before_memory_is_taken) {
    const auto replaced = [](std::string text, const std::string& what, const std::string& by) {
        return text.replace(text.find(what), what.size(), by);
    };
    const std::string good = ply_header("ascii", "float") + square_rows + "4 0 1 2 3\n";
    const std::vector<std::array<std::string, 3>> wrongs = {
        {"1 1 0", "nan 1 0", "'nan' is no number"},
        {"1 1 0", "1 1 x", "'x' is no number"},
        {"4 0 1 2 3", "4 0 1 2 9", "face 0 names vertex 9, and the file has 4"},
        {"4 0 1 2 3", "4 0 1 2 -1", "names vertex -1"},
        {"4 0 1 2 3", "2 0 1", "has 2 corners"},
        {"4 0 1 2 3", "200 0 1", "longer than the file"},
        {"4 0 1 2 3", "4 0 1 2", "is cut off"},
        {"vertex 4", "vertex 4000000000", "too short for it"},
        {"vertex 4", "vertex 18446744073709551615", ":4: "},
        {"face 1", "face 99999999", "too short for it"},
        {"format ascii 1.0", "format ascii 2.0", ":2: "},
        {"format ascii 1.0\n", "", "has no line `format`"},
        {"end_header", "end_head", "is no line of a PLY header"},
        {"property float z", "property float w", "has vertices without x, y and z"},
        {"property float z", "property half z", "is no line of a PLY header"},
        {"vertex_indices", "corners", "has faces without a list `vertex_indices`"}};
    EXPECT_PRED2(contains, refusal("m.ply", good), "was read");
    for (const auto& [what, by, why] : wrongs) EXPECT_PRED2(contains, refusal("m.ply", replaced(good, what, by)), why);
}

TEST_F(MeshBinaries, gltf_data_are_in_the_file_in_its_text_or_beside_it) {
    Gltf square;
    const auto check = [&](const std::string& name, const std::string& bytes) {
        const auto mesh = read_mesh(write(name, bytes));
        ASSERT_TRUE(mesh) << mesh.error().message;
        EXPECT_NEAR(area(*mesh), 1, 1e-6);
        EXPECT_EQ(mesh->groups, (std::vector<std::string>{"card"}));
    };
    check("m.glb", square.glb());
    write("the data.bin", square.data());
    square.buffer = R"(,"uri":"the%20data.bin")";
    check("m.gltf", square.json());
    // By `base64 -w0` of coreutils; a byte more, without the padding; and what is none.
    const std::string text = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAM";
    for (const char* end : {"A", "AAA"}) {
        square.buffer = R"(,"uri":"data:application/octet-stream;base64,)" + text + end + "\"";
        check("m.gltf", square.json());
    }
    square.buffer = R"(,"uri":"data:application/octet-stream;base64,)" + text + "*\"";
    EXPECT_PRED2(contains, refusal("m.gltf", square.json()), "something else than base64");
    for (const std::string uri : {"../m.bin", "/etc/passwd", "file:///etc/passwd", "http://a/b", "a/%2e%2e/%2e%2e/b"}) {
        square.buffer = R"(,"uri":")" + uri + "\"";
        EXPECT_PRED2(contains, refusal("m.gltf", square.json()), "lies outside of its folder");
    }
    square.buffer = R"(,"uri":"none.bin")";
    EXPECT_PRED2(contains, refusal("m.gltf", square.json()), "No such file");
}

TEST_F(MeshBinaries, gltf_nodes_place_their_meshes) {
    Gltf file;
    // Twice as wide, three times as high, then a quarter turn about z, then moved.
    file.node = R"(,"scale":[2,3,1],"rotation":[0,0,0.70710678,0.70710678],"translation":[10,0,0])";
    auto mesh = read_mesh(write("m.glb", file.glb()));
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_NEAR(area(*mesh), 6, 1e-5);
    const auto extremes = std::minmax_element(mesh->positions.begin(), mesh->positions.end(),
                                              [](Float3 a, Float3 b) { return a.x < b.x; });
    EXPECT_NEAR(extremes.first->x, 7, 1e-5);
    EXPECT_NEAR(extremes.second->x, 10, 1e-5);
    // A mirrored node's faces keep their outsides (specification 3.7.4).
    file.node = R"(,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1])";
    mesh = read_mesh(write("m.glb", file.glb()));
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_NEAR(area(*mesh), 1, 1e-6);
    // Strips and fans of triangles.
    for (const auto& [mode, order] :
         {std::pair{5, bytes_of<uint16_t>({0, 1, 3, 2})}, std::pair{6, bytes_of<uint16_t>({0, 1, 2, 3})}}) {
        Gltf other;
        other.indices = order;
        other.primitive = fmt::format(R"(,"mode":{})", mode);
        mesh = read_mesh(write("m.glb", other.glb()));
        ASSERT_TRUE(mesh) << mesh.error().message;
        EXPECT_NEAR(area(*mesh), 1, 1e-6) << mode;
    }
}

TEST_F(MeshBinaries, a_gltf_file_that_is_wrong_is_refused) {
    const auto why = [&](const auto& change) {
        Gltf file;
        change(file);
        return refusal("m.glb", file.glb());
    };
    EXPECT_PRED2(contains, why([](Gltf& f) {
                     f.indices = bytes_of<uint16_t>({0, 1, 2, 0, 2, 9});
                 }),
                 "names vertex 9 of 4");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.indices = bytes_of<uint16_t>({0, 1, 2, 0}); }), "a part of one");
    EXPECT_PRED2(
        contains, why([](Gltf& f) {
            f.positions = bytes_of<float>({std::numeric_limits<float>::quiet_NaN(), 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
        }),
        "holds a value that is no number");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.accessor = R"(,"count":400000000)"; }), "reaches beyond its bufferView");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.accessor = R"(,"byteOffset":18446744073709551615)"; }),
                 "reaches beyond");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.accessor = R"(,"sparse":{})"; }), "sparse");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.node = R"(,"children":[0])"; }), "stands twice in the tree");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.roots = "7"; }), "no 7 of nodes");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.node = R"(,"scale":[1e308,1e308,1e308])"; }), "beyond any place");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.top = R"(,"extensionsRequired":["KHR_draco_mesh_compression"])"; }),
                 "needs the extension KHR_draco_mesh_compression");
    EXPECT_PRED2(contains, why([](Gltf& f) { f.node = R"(,"name":7)"; }), "cannot be read as glTF");
    const std::string good = Gltf().glb();
    EXPECT_PRED2(contains, refusal("m.glb", good.substr(0, good.size() - 8)), "cut off");
    EXPECT_PRED2(contains, refusal("m.gltf", std::string(60'000, '[')), "nests too deep");
    EXPECT_PRED2(contains, refusal("m.gltf", "{}"), "cannot be read as glTF");
}

TEST_F(MeshBinaries, a_gltf_file_that_repeats_its_data_is_bounded) {
    // 60 parts of the same 30000 triangles: 5.4 million corners of 180 KB.
    std::string indices, parts;
    for (int i = 0; i < 30'000; ++i) indices += bytes_of<uint16_t>({0, 1, 2});
    for (int i = 0; i < 60; ++i) parts += R"({"attributes":{"POSITION":0},"indices":1},)";
    Gltf file;
    file.indices = indices;
    std::string text = file.json();
    const std::string list = R"("primitives":[)";
    text.insert(text.find(list) + list.size(), parts);
    write("m.bin", file.data());
    const std::string end = R"("byteLength":)" + std::to_string(file.data().size()) + "}";
    text.replace(text.rfind(end), end.size(), end.substr(0, end.size() - 1) + R"(,"uri":"m.bin"})");
    EXPECT_PRED2(contains, refusal("m.gltf", text), "it repeats its data");
}
