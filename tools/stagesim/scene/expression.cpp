// SPDX-License-Identifier: MIT
// Targets from files, and their weights over time.
#include "scene/expression.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>

#include "image/input_file.hpp"
#include "scene/numbers.hpp"

namespace ols {

namespace {

// Which vertices of the mesh came from each vertex of its file.
std::vector<std::vector<uint32_t>> vertices_of_file(const Mesh& mesh) {
    std::vector<std::vector<uint32_t>> vertices;
    for (uint32_t i = 0; i < mesh.file_vertices.size(); ++i) {
        if (mesh.file_vertices[i] >= vertices.size()) vertices.resize(mesh.file_vertices[i] + 1);
        vertices[mesh.file_vertices[i]].push_back(i);
    }
    return vertices;
}

}  // namespace

Result<MeshTarget> read_target(const std::string& path, const Mesh& mesh, const MeshPlacement& placement) {
    const auto bytes = read_input(path, "target", mesh_bytes_max);
    if (!bytes) return fail(bytes.error().message + " (the head's come with `make assets`)");
    const Pose turned{placement.rotation, {}};
    const auto vertices = vertices_of_file(mesh);
    MeshTarget target;
    std::vector<bool> seen(vertices.size(), false);
    std::istringstream file(*bytes);
    std::string line;
    for (int number = 1; std::getline(file, line); ++number) {
        if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
        if (line.ends_with('\r')) line.pop_back();
        const auto words = words_of(std::string_view(line).substr(0, line.find('#')));
        if (words.empty()) continue;
        const auto vertex = whole_number(words[0]);
        std::array<std::optional<double>, 3> offset;
        for (size_t i = 0; i < 3 && i + 1 < words.size(); ++i) offset[i] = decimal_number(words[i + 1]);
        if (words.size() != 4 || !vertex || !offset[0] || !offset[1] || !offset[2])
            return fail(fmt::format("{}:{}: '{:.60}' is not `vertex dx dy dz`", path, number, line));
        if (*vertex < 0 || *vertex >= int64_t(vertices.size()) || vertices[size_t(*vertex)].empty())
            return fail(
                fmt::format("{}:{}: the mesh has no vertex {} in its faces: was the target made for another mesh?",
                            path, number, *vertex));
        if (seen[size_t(*vertex)]) return fail(fmt::format("{}:{}: vertex {} moves twice", path, number, *vertex));
        seen[size_t(*vertex)] = true;
        const Vec3 moved = turned.turn(Vec3{*offset[0], *offset[1], *offset[2]} * placement.scale);
        if (!(length(moved) <= reach_max_m))
            return fail(fmt::format("{}:{}: moves vertex {} by more than {} m", path, number, *vertex, reach_max_m));
        for (const uint32_t v : vertices[size_t(*vertex)]) {
            target.vertices.push_back(v);
            target.offsets.push_back(to_float3(moved));
        }
    }
    if (target.vertices.empty()) return fail("'" + path + "' moves no vertex: it holds no line `vertex dx dy dz`");
    return target;
}

double weight_at(const Expression& expression, double time_us) {
    const auto& keys = expression.keys;
    if (keys.empty()) return 0;
    if (expression.period_us > 0) time_us -= std::floor(time_us / expression.period_us) * expression.period_us;
    const auto after =
        std::upper_bound(keys.begin(), keys.end(), time_us, [](double t, const WeightKey& k) { return t < k.time_us; });
    if (after == keys.begin()) return after->weight;
    const WeightKey& before = *(after - 1);
    if (after == keys.end()) return before.weight;
    const double t = (time_us - before.time_us) / (after->time_us - before.time_us);
    return before.weight + (after->weight - before.weight) * (1 - std::cos(std::numbers::pi * t)) / 2;
}

bool moves(const Expression& expression) {
    return std::any_of(expression.keys.begin(), expression.keys.end(),
                       [&](const WeightKey& k) { return k.weight != expression.keys[0].weight; });
}

std::vector<Float3> deformed_positions(const Mesh& mesh, const std::vector<Expression>& expressions,
                                       const std::vector<double>& weights) {
    std::vector<Float3> positions = mesh.positions;
    for (size_t e = 0; e < expressions.size(); ++e) {
        if (weights[e] == 0) continue;
        const MeshTarget& target = expressions[e].target;
        for (size_t i = 0; i < target.vertices.size(); ++i) {
            Float3& p = positions[target.vertices[i]];
            p = p + target.offsets[i] * float(weights[e]);
        }
    }
    return positions;
}

}  // namespace ols
