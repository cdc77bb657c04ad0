// SPDX-License-Identifier: MIT
// Looks of meshes, evaluated once on a fine lattice and interpolated: a moving subject shows the same skin in every frame.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "scene/geometry.hpp"
#include "scene/texture.hpp"

namespace ols {

// Each triangle's looks at the corners of a regular barycentric lattice, linear between them, as the mesh colors of Yuksel,
// Keyser and House (2010, section 3); corners on an edge are kept with both of its triangles. A triangle is evaluated when it is
// first met. An approximation: what is finer than the lattice is lost, from wherever it is seen.
class BakedLooks {
  public:
    // Lattice corners at most `step_m` apart. The scene must outlive this.
    BakedLooks(const Scene& scene, float step_m);

    // Spheres have no lattice: their looks are exact. The same for any number of threads and order of calls.
    Look at(const SurfaceHit& hit);

  private:
    struct Lattice {
        std::once_flag once;
        std::atomic<bool> is_evaluated = false;  // read at every hit: call_once costs as much as the look
        int steps = 1;                           // along each side
        std::vector<Look> looks;  // row j (weight of the third corner j / steps) has steps + 1 - j of them
    };
    void evaluate(const SurfaceHit& hit, Lattice& lattice) const;

    const Scene& scene_;
    float step_m_;
    std::vector<std::vector<Lattice>> lattices_;  // [object][triangle]
};

}  // namespace ols
