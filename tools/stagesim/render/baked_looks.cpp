// SPDX-License-Identifier: MIT
// The lattice of a triangle, and where a hit lies in it.
#include "render/baked_looks.hpp"

#include <algorithm>
#include <cmath>

namespace ols {

namespace {

constexpr int most_steps = 1024;

// Of the look at lattice corner (i, j).
size_t index_of(int steps, int i, int j) {
    return size_t(j) * size_t(2 * steps + 3 - j) / 2 + size_t(i);
}

Look weighted(const Look& a, float wa, const Look& b, float wb, const Look& c, float wc) {
    return {a.albedo * wa + b.albedo * wb + c.albedo * wc, a.roughness * wa + b.roughness * wb + c.roughness * wc,
            a.f0 * wa + b.f0 * wb + c.f0 * wc, a.slope * wa + b.slope * wb + c.slope * wc};
}

}  // namespace

BakedLooks::BakedLooks(const Scene& scene, float step_m) : scene_(scene), step_m_(step_m) {
    for (const Object& object : scene.objects) {
        const Mesh* mesh = std::get_if<Mesh>(&object.shape);
        lattices_.emplace_back(mesh ? mesh->triangles.size() : 0);
    }
}

void BakedLooks::evaluate(const SurfaceHit& hit, Lattice& lattice) const {
    const Object& object = scene_.objects[hit.object];
    const Mesh& mesh = std::get<Mesh>(object.shape);
    const auto& corner = mesh.triangles[hit.triangle].vertex;
    const auto side = [&](int a, int b) { return length(mesh.positions[corner[a]] - mesh.positions[corner[b]]); };
    const float longest = std::max({side(0, 1), side(1, 2), side(2, 0)});
    const int steps = lattice.steps = std::clamp(int(std::ceil(longest / step_m_)), 1, most_steps);
    lattice.looks.reserve(index_of(steps, 0, steps) + 1);
    for (int j = 0; j <= steps; ++j)
        for (int i = 0; i <= steps - j; ++i) {
            const float u = float(i) / float(steps), v = float(j) / float(steps);
            const auto among = [&](const std::vector<Float3>& values) {
                return values[corner[0]] * (1 - u - v) + values[corner[1]] * u + values[corner[2]] * v;
            };
            lattice.looks.push_back(look_of(scene_.materials[hit.material], among(mesh.positions), among(mesh.masks)));
        }
}

Look BakedLooks::at(const SurfaceHit& hit) {
    if (lattices_[hit.object].empty()) return look_of(scene_.materials[hit.material], hit.rest_position, hit.mask);
    Lattice& lattice = lattices_[hit.object][hit.triangle];
    if (!lattice.is_evaluated.load(std::memory_order_acquire))
        std::call_once(lattice.once, [&] {
            evaluate(hit, lattice);
            lattice.is_evaluated.store(true, std::memory_order_release);
        });

    // The small triangle of the lattice: one that stands as the large one does, or one upside down.
    const int steps = lattice.steps;
    const float x = std::max(0.0f, hit.u) * float(steps), y = std::max(0.0f, hit.v) * float(steps);
    const int j = std::min(int(y), steps - 1), i = std::min(int(x), steps - 1 - j);
    const float fx = x - float(i), fy = y - float(j);
    const auto look = [&](int di, int dj) -> const Look& { return lattice.looks[index_of(steps, i + di, j + dj)]; };
    // On the long side rounding may lead a little beyond the last upright one, which is then continued.
    if (fx + fy <= 1 || i + j == steps - 1) return weighted(look(0, 0), 1 - fx - fy, look(1, 0), fx, look(0, 1), fy);
    return weighted(look(1, 1), fx + fy - 1, look(0, 1), 1 - fx, look(1, 0), 1 - fy);
}

}  // namespace ols
