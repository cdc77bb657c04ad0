// SPDX-License-Identifier: MIT
// The sphere shared out among lamps: each direction belongs to the lamp nearest to it (spherical Voronoi cells).
#pragma once

#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

// A lamp's cell is the set of directions closer to it than to any other lamp, { d : d.(l_i - l_j) >= 0 for all j }, a
// convex cone. It is computed for each lamp by clipping the eight octants of the sphere against the bisecting great
// circles, nearest lamps first, until no further lamp can reach the cell. This needs no hull, so lamps in one
// hemisphere, in one plane, or a single lamp work as well as a whole sphere of them; cells are then large, which
// `reach` tells.
class SphereCells {
  public:
    struct Neighbor {
        int lamp;
        Vec3 normal;  // unit, of the great circle between the two lamps, towards the cell's own lamp
    };

    // `directions` need not be of unit length. Errors: no lamp, a zero or non-finite direction, two lamps closer than
    // 1e-6 rad (they would share a cell in an arbitrary way); lamps are named by their number.
    static Result<SphereCells> make(const std::vector<Vec3>& directions);

    int size() const { return int(directions_.size()); }
    const std::vector<Vec3>& directions() const { return directions_; }  // unit length

    // Steradians; all of them sum to 4 pi.
    double solid_angle(int lamp) const { return solid_angles_[lamp]; }
    const std::vector<double>& solid_angles() const { return solid_angles_; }

    // The angle from the lamp to the farthest point of its cell, radians: how wrong the direction of light may be.
    double reach(int lamp) const { return reaches_[lamp]; }

    // The lamps whose cells share an edge with this one.
    const std::vector<Neighbor>& neighbors(int lamp) const { return neighbors_[lamp]; }

    // The lamp whose cell holds a direction (any length), found by walking from `start` to ever nearer neighbours.
    int nearest(Vec3 direction, int start = 0) const;

  private:
    SphereCells() = default;

    std::vector<Vec3> directions_;
    std::vector<double> solid_angles_, reaches_;
    std::vector<std::vector<Neighbor>> neighbors_;
};

}  // namespace ols
