// SPDX-License-Identifier: MIT
// Faces that move: a mesh's vertices displaced by targets (blend shapes), each weighted by a function of time.
#pragma once

#include <string>
#include <vector>

#include "result.hpp"
#include "scene/mesh.hpp"

namespace ols {

// Offsets of some vertices, in metres of the mesh as it is placed in the scene.
struct MeshTarget {
    std::vector<uint32_t> vertices;  // of Mesh::positions, each once
    std::vector<Float3> offsets;
};

struct WeightKey {
    double time_us = 0, weight = 0;
};

struct Expression {
    std::string name;
    MeshTarget target;
    std::vector<WeightKey> keys;  // ascending in time
    double period_us = 0;         // the keys repeat after so long; 0: never
};

// Reads lines `vertex dx dy dz` (MakeHuman's .target format: vertices of the mesh file counted from 0, `#` comments), offsets in the
// file's unit, which are scaled and turned with the mesh. Errors name file and line: no file, a bad number, an offset of more than
// reach_max_m, a vertex the mesh lacks, nothing at all.
Result<MeshTarget> read_target(const std::string& path, const Mesh& mesh, const MeshPlacement& placement = {});

// From key to key along half a cosine, so that nothing jerks; held before the first and after the last. No key: 0.
double weight_at(const Expression& expression, double time_us);

// Whether any two keys differ.
bool moves(const Expression& expression);

// mesh.positions plus the weighted targets.
std::vector<Float3> deformed_positions(const Mesh& mesh, const std::vector<Expression>& expressions,
                                       const std::vector<double>& weights);

}  // namespace ols
