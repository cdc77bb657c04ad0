// SPDX-License-Identifier: MIT
// Mesh files as others write them: the triangles and the area that arithmetic says, or a refusal that says why.
// links: ols_stagesim
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "scene/mesh.hpp"
#include "scratch_folder.hpp"

using namespace ols;

namespace {

class MeshFiles : public ScratchFolder {
  protected:
    Result<Mesh> read(const std::string& text, const MeshPlacement& placement = {}) {
        return read_mesh(write("mesh.obj", text), placement);
    }
    std::string refusal(const std::string& text) {
        const auto mesh = read(text);
        return mesh ? "was read" : mesh.error().message;
    }
};

// Against +z: a triangle that is turned over counts against the others.
double area(const Mesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const Float3 a = mesh.positions[t.vertex[0]];
        sum += 0.5 * cross(mesh.positions[t.vertex[1]] - a, mesh.positions[t.vertex[2]] - a).z;
    }
    return sum;
}

double absolute_area(const Mesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const Float3 a = mesh.positions[t.vertex[0]];
        sum += 0.5 * length(cross(mesh.positions[t.vertex[1]] - a, mesh.positions[t.vertex[2]] - a));
    }
    return sum;
}

bool contains(const std::string& text, const std::string& what) {
    return text.find(what) != text.npos;
}

std::string notes(const Mesh& mesh) {
    std::string all;
    for (const std::string& note : mesh.notes) all += note + "\n";
    return all;
}

using Points = std::vector<std::array<double, 2>>;

// One polygon of all points, which turns left.
std::string polygon(const Points& points) {
    std::string text, face = "f";
    for (size_t i = 0; i < points.size(); ++i) {
        text += fmt::format("v {:.17g} {:.17g} 0\n", points[i][0], points[i][1]);
        face += fmt::format(" {}", i + 1);
    }
    return text + face + "\n";
}

// The trapezoids under the edges.
double shoelace(const Points& p) {
    double twice = 0;
    for (size_t i = 0; i < p.size(); ++i) {
        const auto &a = p[i], &b = p[(i + 1) % p.size()];
        twice += (b[1] + a[1]) * (a[0] - b[0]);
    }
    return twice / 2;
}

Points star(int spikes) {
    Points points;
    for (int i = 0; i < 2 * spikes; ++i) {
        const double radius = i % 2 == 0 ? 1 : 0.4, angle = std::numbers::pi * i / spikes;
        points.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    return points;
}

Points comb(int teeth) {
    Points points = {{0, -1}, {double(teeth), -1}};
    for (int i = teeth; i > 0; --i) {
        points.push_back({double(i), 1});
        points.push_back({i - 0.5, 0});
    }
    points.push_back({0, 1});
    return points;
}

Points spiral(int turns) {
    Points points;
    const int steps = 24 * turns;
    for (int i = 0; i <= steps; ++i) {
        const double angle = std::numbers::pi * i / 12, radius = 1 + angle;
        points.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    for (int i = steps; i >= 0; --i) {
        const double angle = std::numbers::pi * i / 12, radius = 0.5 + angle;
        points.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    std::reverse(points.begin(), points.end());
    return shoelace(points) > 0 ? points : Points(points.rbegin(), points.rend());
}

const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

}  // namespace

TEST_F(MeshFiles, concave_polygons_keep_to_their_outline_wherever_they_begin) {
    const std::vector<Points> shapes = {{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}},
                                        {{0, 0}, {4, 0}, {1, 1}, {0, 4}},
                                        {{0, 0}, {1, 0}, {2, 0}, {2, 2}, {1, 2}, {0, 2}, {0, 1}},
                                        star(5),
                                        star(50),
                                        comb(20),
                                        spiral(3)};
    for (Points shape : shapes)
        for (size_t begin = 0; begin < shape.size(); ++begin) {
            const auto mesh = read(polygon(shape));
            ASSERT_TRUE(mesh) << mesh.error().message;
            EXPECT_LE(mesh->triangles.size(), shape.size() - 2);
            EXPECT_NEAR(area(*mesh), shoelace(shape), 1e-5 * shoelace(shape)) << begin;
            EXPECT_NEAR(absolute_area(*mesh), shoelace(shape), 1e-5 * shoelace(shape)) << begin;
            std::rotate(shape.begin(), shape.begin() + 1, shape.end());
        }
}

TEST_F(MeshFiles, polygons_that_repeat_corners_or_join_a_hole_to_their_outline_are_cut) {
    const auto repeated = read(square + "f 1 2 2 3 4\n");
    ASSERT_TRUE(repeated) << repeated.error().message;
    EXPECT_NEAR(absolute_area(*repeated), 1, 1e-6);
    const auto hole =
        read("v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nv 1 1 0\nv 2 1 0\nv 2 2 0\nv 1 2 0\nf 1 2 3 4 1 5 8 7 6 5\n");
    ASSERT_TRUE(hole) << hole.error().message;
    EXPECT_NEAR(absolute_area(*hole), 8, 1e-5);
    // Not quite plane, and standing upright: its area is the plane one's but for the bend's square.
    const auto bent = read("v 0 0 .01\nv 0 2 0\nv 0 2 1.01\nv 0 1 1\nv 0 1 2\nv 0.01 0 2\nf 1 2 3 4 5 6\n");
    ASSERT_TRUE(bent) << bent.error().message;
    EXPECT_NEAR(absolute_area(*bent), 3, 0.02);
}

TEST_F(MeshFiles, polygons_without_an_inside_are_refused_and_those_without_area_left_out) {
    EXPECT_PRED2(contains, refusal(square + "f 1 2 4 3\n"), "mesh.obj:5: crosses itself");
    Points pentagram;
    for (int i = 0; i < 5; ++i)
        pentagram.push_back({std::cos(4 * std::numbers::pi * i / 5), std::sin(4 * std::numbers::pi * i / 5)});
    EXPECT_PRED2(contains, refusal(polygon(pentagram)), "crosses itself");
    EXPECT_PRED2(contains, refusal(polygon(star(2500))), "has 5000 corners and may have 4096");
    const auto flat = read(square + "v 0.5 0 0\nf 1 5 2\nf 1 2 3 4\n");
    ASSERT_TRUE(flat);
    EXPECT_EQ(flat->triangles.size(), 2u);
    EXPECT_PRED2(contains, notes(*flat), "1 faces have no area and are left out");
    EXPECT_PRED2(contains, refusal(square + "f 1 1 1\n"), "holds no faces");
}

TEST_F(MeshFiles, a_mesh_far_off_is_as_exact_as_one_nearby_once_it_is_placed) {
    const std::string far =
        "v 1000000 1000000 1000000\nv 1000000.01 1000000 1000000\nv 1000000.01 1000000.01 1000000\n"
        "v 1000000 1000000.01 1000000\nf 1 2 3 4\n";
    const auto mesh = read(far, {1, {1, 0, 0, 0}, {-1e6, -1e6, -1e6}});
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_NEAR(area(*mesh), 1e-4, 1e-11);
    EXPECT_NEAR(mesh->positions[2].x, 0.01, 1e-9);  // a double near 10^6 has steps of 1e-10
    EXPECT_PRED2(contains, refusal(far), "more than 1000 m from the stage's centre");
    const auto millimetres = read("v 0 0 0\nv 250 0 0\nv 0 250 0\nf 1 2 3\n", {0.001, {1, 0, 0, 0}, {}});
    ASSERT_TRUE(millimetres);
    EXPECT_NEAR(area(*millimetres), 0.03125, 1e-8);
}

TEST_F(MeshFiles, the_same_square_is_read_however_it_is_written) {
    std::string old_mac = square + "f 1 2 3 4\n";
    std::replace(old_mac.begin(), old_mac.end(), '\n', '\r');
    const std::vector<std::string> writings = {square + "f 1 2 3 4",
                                               "\xef\xbb\xbf" + square + "f 1 2 3 4\n",
                                               "v 0 0 0\nv +1 0 -0\nv +1.0 1.e0 +0\nv .0 +1E+0 0\nf +1 2 3 4\n",
                                               "v 1e-320 4.9e-324 1e-4000\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
                                               square + "f 1 2 \\\n3 4\n",
                                               square + "f 1 \\\r\n 2 \\\r\n 3 4 \\",
                                               square + "f 1 2 3 4 # the only one\n#f 1 2 3\n",
                                               old_mac,
                                               "\t v  0\t0 0 \r\nv 1 0 0\r\n\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3 4\r\n",
                                               square + "f -4 -3 -2 -1\n",
                                               square + "vt 0 0\nf 1/1 2/1 3/1 4/1\n",
                                               "f 1 2 3 4\n" + square};
    for (const std::string& text : writings) {
        const auto mesh = read(text);
        ASSERT_TRUE(mesh) << mesh.error().message << " in\n" << text;
        EXPECT_EQ(mesh->triangles.size(), 2u);
        EXPECT_NEAR(area(*mesh), 1, 1e-6) << text;
    }
}

TEST_F(MeshFiles, each_face_has_its_own_normals_or_the_surfaces) {
    // The second face stands on the first one's edge, has no normals and looks along -y.
    const auto mixed = read(square + "v 0 0 1\nv 1 0 1\nvn 0 0.6 8e-1\nf 1//1 2//1 3//1 4//1\nf 1 2 6 5\n");
    ASSERT_TRUE(mixed) << mixed.error().message;
    EXPECT_EQ(mixed->positions.size(), 8u);
    for (size_t i = 0; i < mixed->triangles.size(); ++i)
        for (const uint32_t v : mixed->triangles[i].vertex) {
            const Float3 wanted = i < 2 ? Float3{0, 0.6f, 0.8f} : Float3{0, -1, 0};
            EXPECT_NEAR(length(mixed->normals[v] - wanted), 0, 1e-6);
        }
    for (const std::string end : {"vn 0 0 0\nf 1//1 2//1 3//1 4//1\n", "f 1//1 2//2 3//3 4//4\n"}) {
        const auto mesh = read(square + end);
        ASSERT_TRUE(mesh) << mesh.error().message;
        for (const Float3 n : mesh->normals) EXPECT_EQ(n, (Float3{0, 0, 1}));
        EXPECT_PRED2(contains, notes(*mesh), "theirs come from their faces");
        EXPECT_FALSE(mesh->has_own_normals);
    }
}

TEST_F(MeshFiles, what_is_not_used_is_said_once) {
    const auto mesh = read(
        "mtllib my head.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0\nv 0 1 0 0.5 0.5 0.5\nv 9 9 9\nvt 0 0\nvt 1 0\n"
        "o left eye\nusemtl my skin # of the\ns off\nf 1 2 3\ng right ear\nf 1 3 4\nl 1 2\np 3\nf 1 3 4\nf 4 3 1\n");
    ASSERT_TRUE(mesh) << mesh.error().message;
    EXPECT_EQ(mesh->groups, (std::vector<std::string>{"left eye", "right ear"}));
    EXPECT_TRUE(mesh->has_colors);
    for (const std::string note :
         {"2 texture coordinates", "1 materials (usemtl)", "1 material files", "1 smoothing groups", "1 lines",
          "1 points", "3 of 5 vertices have colours", "1 vertices belong to no face", "1 triangles stand there twice",
          "1 triangles are the back of another one"})
        EXPECT_PRED2(contains, notes(*mesh), note);
    EXPECT_EQ(std::count_if(mesh->notes.begin(), mesh->notes.end(),
                            [](const auto& n) { return n.find("texture coordinates") != n.npos; }),
              1);
    EXPECT_PRED2(contains, notes(*read("v 0 0 0 2\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n")), "a weight, of 1 vertices");
}

TEST_F(MeshFiles, what_is_wrong_in_an_obj_file_is_refused_with_its_line) {
    const std::vector<std::array<std::string, 2>> wrongs = {
        {"v nan 1 0\nf 1 2 3\n", ":1: 'nan' is no number"},
        {"v 0 -inf 0\n", ":1: '-inf' is no number"},
        {"v 1e16 0 0\n", "'1e16' is no number up to 1e+15"},
        {"v 1e400 0 0\n", "'1e400' is no number"},
        {"v 1,5 0 0\n", "decimals have a point"},
        {"v 0x10 0 0\n", "'0x10' is no number"},
        {"v +-1 0 0\n", "'+-1' is no number"},
        {"v 1 2\n", "a vertex has 3 numbers, 4 with a weight or 6 with a colour, and not 2"},
        {"v 1 2 3 4 5 6 7\n", "and not 7"},
        {"vn 1 2\n", ":1: a normal has 3 numbers"},
        {square + "f 1 2 9\n", ":5: names vertex 9, and the file has 4"},
        {square + "f 1 2 -5\n", ":5: index -5 goes back beyond the first of 4"},
        {square + "f 1 2 99999999999\n", "index 99999999999 is beyond any mesh"},
        {square + "f 1 2 -9223372036854775808\n", ":5: "},
        {square + "f 1 2 0\n", "index 0: indices count from 1"},
        {square + "f 1 2\n", ":5: a face has 3 corners or more"},
        {square + "f 1 2 3.5\n", "'3.5' is no index"},
        {square + "f 1/x 2/1 3/1\n", "'x' is no index"},
        {square + "vn 0 0 1\nf 1//2 2//1 3//1\n", ":6: names normal 2, and the file has 1"},
        {square + "faces 1 2 3\n", ":5: 'faces' is no statement"},
        {"\x89PNG\r\n", "is no statement"},
        {square + std::string(1, '\0') + "f 1 2 3\n", "holds a zero byte at 32"},
        {"\xff\xfev", "is UTF-16 text"},
        {"", "holds no faces"}};
    for (const auto& [text, what] : wrongs) EXPECT_PRED2(contains, refusal(text), what) << text;
}

TEST_F(MeshFiles, only_regular_files_of_a_kind_that_is_known_are_opened) {
    const auto why = [](const std::string& path) { return read_mesh(path).error().message; };
    EXPECT_PRED2(contains, why(""), "the path of the mesh is empty");
    EXPECT_PRED2(contains, why(folder_), "it is a folder, not a file");
    const std::string pipe = folder_ / "pipe.obj";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    EXPECT_PRED2(contains, why(pipe), "it is a pipe, not a file");
    EXPECT_PRED2(contains, why("/dev/zero"), "it is a device, not a file");
    EXPECT_PRED2(contains, why(folder_ / "none.obj"), "No such file");
    EXPECT_PRED2(contains, why(write("mesh.stl", "solid\n")), "is no mesh that is known here");
    const std::string large = write("large.obj", "");
    std::filesystem::resize_file(large, mesh_bytes_max + 1);  // takes no room: it is one hole
    EXPECT_PRED2(contains, why(large), "a mesh has at most 1073741824");
}
