// SPDX-License-Identifier: MIT
// Fuzzes the readers of meshes with OBJ, PLY, glTF and GLB files: any bytes give a mesh whose triangles have vertices, unit normals
// and places in reach, or an error. Bytes of 0x80 and above stand for words of the formats that are text.
// links: ols_mesh
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "scene/mesh.hpp"
#include "words.hpp"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

constexpr std::array<const char*, 32> words = {
    "v ",
    "vn ",
    "f ",
    "\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n",
    "\nf 1 2 3 4\n",
    "1//1",
    " -1",
    "1e308",
    "nan",
    "\\\n",
    "usemtl a\n",
    "ply\nformat ascii 1.0\n",
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n",
    "element face 1\nproperty list uchar int vertex_indices\n",
    "end_header\n",
    "0 0 0 1 0 0 1 1 0 0 1 0 4 0 1 2 3",
    "property uchar red\n",
    "{\"asset\":{\"version\":\"2.0\"},",
    "\"scenes\":[{\"nodes\":[0]}],",
    "\"nodes\":[{\"mesh\":0}],",
    "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],",
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],",
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],",
    "\"buffers\":[{\"byteLength\":36,\"uri\":\"data:a;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAA\"}]}",
    "4294967296",
    "\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],",
    "\"children\":[0],",
    "\n",
    " ",
    "binary_little_endian",
    "vn 0 0 0\n",
    "/"};

void check(const ols::Mesh& mesh) {
    expect(!mesh.triangles.empty());
    expect(mesh.normals.size() == mesh.positions.size() && mesh.masks.size() == mesh.positions.size());
    for (const ols::Triangle& triangle : mesh.triangles) {
        expect(triangle.group < mesh.groups.size());
        for (const uint32_t v : triangle.vertex) expect(v < mesh.positions.size());
    }
    for (const ols::Float3 p : mesh.positions) expect(length(p) <= float(ols::reach_max_m) * 1.001f);
    for (const ols::Float3 n : mesh.normals) expect(std::abs(length(n) - 1) < 1e-3f || length(n) == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    if (size == 0) return 0;
    const std::string rest =
        bytes[0] % 2 == 0 ? std::string(bytes + 1, bytes + size) : with_words({bytes + 1, size - 1}, words);
    const auto file = bytes[0] / 2 % 3 == 0   ? ols::parse_obj("fuzz.obj", rest)
                      : bytes[0] / 2 % 3 == 1 ? ols::parse_ply("fuzz.ply", rest)
                                              : ols::parse_gltf("/nonexistent/fuzz.gltf", rest);
    if (!file) {
        expect(file.error().message.find("fuzz.") != std::string::npos);
        return 0;
    }
    const auto mesh = ols::build_mesh(*file, {});
    if (mesh) check(*mesh);
    return 0;
}
