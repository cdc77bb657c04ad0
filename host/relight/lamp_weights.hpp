// SPDX-License-Identifier: MIT
// How much light each lamp has to give to stand for an environment or for point lights.
#pragma once

#include <array>
#include <vector>

#include "relight/environment.hpp"
#include "relight/sphere_cells.hpp"
#include "result.hpp"

namespace ols {

using Rgb = std::array<double, 3>;

// A lamp's weight is the irradiance on a surface facing it: the integral of radiance over its cell. Relighting is
// I = 1/pi sum_i r_i weight_i, so that a white Lambertian surface under radiance 1 everywhere shows 1.
struct LampWeights {
    std::vector<Rgb> irradiance;  // one for each lamp
};

struct EnvironmentOptions {
    double rotate_rad = 0;   // the environment turns about +Y by the right-hand rule: light from +Z moves to +X
    double exposure_ev = 0;  // all radiance times 2^EV
    // Texels across a border between cells are split in four until no point of a part is farther than this from its
    // middle; such a part is shared between its two lamps in proportion. Energy is conserved whatever the tolerance.
    double border_tolerance_rad = 1e-3;
};

// Every texel gives its radiance times its whole solid angle, so a sun of one texel is never missed. Method: Debevec et
// al., "Acquiring the Reflectance Field of a Human Face", SIGGRAPH 2000, section 3.4, with exact Voronoi cells in place
// of resampling the map to the lamps' grid.
LampWeights integrate_environment(const Environment& environment, const SphereCells& cells,
                                  const EnvironmentOptions& options = {});

// What some lamps give of all lamps' light, 0..1, red, green and blue together: what a picture lacks without them.
double share_of_light(const LampWeights& weights, const std::vector<int>& lamps);

struct PointLight {
    Vec3 direction;  // towards the light; any length
    Rgb color;       // irradiance on a surface facing the light, over pi: what a white Lambertian surface there shows
};

// Adds a point light to the lamp nearest to it, so that a light of colour 1 in a lamp's direction shows that lamp's
// OLAT image as it is. Returns the lamp.
int add_point_light(const PointLight& light, const SphereCells& cells, LampWeights& weights);

}  // namespace ols
