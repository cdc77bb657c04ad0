// SPDX-License-Identifier: MIT
// Environment maps: radiance from every direction, and where on the sphere each texel lies.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/exr.hpp"
#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

// How a map is laid out. All are in the stage's coordinates: +X right, +Y up, +Z towards the camera.
enum class EnvConvention {
    // Latitude-longitude as OpenEXR defines it: top left is latitude +pi/2, longitude +pi; the centre is +Z, +X is left
    // of it: a panorama as seen from the subject, who looks at the camera. Texels are areas, as every renderer takes
    // them: the corner of the top left texel has these coordinates, where the OpenEXR library puts its centre (half a
    // texel off).
    openexr,
    // The same with +X right of the centre: a panorama that was mirrored left to right.
    mirrored,
    // Angular probe (Debevec, "Light Probe Image Gallery"): the inscribed circle holds the sphere, the angle from -Z
    // grows with the distance from the centre, +X is right and +Y up.
    angular,
};

// "openexr", "mirrored", "angular"; the error lists them.
Result<EnvConvention> parse_env_convention(const std::string& name);

// A rectangle of a map in texel-independent coordinates: u from 0 (left) to 1 (right), v from 0 (top) to 1 (bottom).
struct EnvPatch {
    double u0, u1, v0, v1;
};

Vec3 env_direction(EnvConvention convention, double u, double v);         // unit
double env_solid_angle(EnvConvention convention, const EnvPatch& patch);  // steradians; exact for latitude-longitude

// An upper bound of the angle (radians) between a patch's middle and any of its points.
double env_reach(EnvConvention convention, const EnvPatch& patch);

struct Environment {
    Image radiance;  // 3 channels, finite, not negative
    EnvConvention convention = EnvConvention::openexr;
    size_t clamped_negative = 0;             // texels that had a negative channel, now 0 there
    size_t clamped_non_finite = 0;           // texels that had NaN or Inf, now 0 there
    std::vector<std::string> warnings = {};  // what the user should know of these and of the file: a phrase each
};

// Takes 1, 3 or 4 channels (alpha is ignored), clamps what is negative or not finite to 0 and counts such texels.
Environment make_environment(const Image& pixels, EnvConvention convention);

// Reads an OpenEXR (.exr) or Radiance (.hdr) map, told apart by their first bytes. Without a convention the file's `envmap`
// attribute decides, and a file without one is taken as OpenEXR's latitude-longitude, with a warning if it is not twice as wide as
// high. Errors name the file: not readable, another kind of file, a cube map or of such a shape, an angular probe that is not
// square.
Result<Environment> read_environment(const std::string& path, std::optional<EnvConvention> convention = std::nullopt,
                                     const ExrChoice& choice = {});

}  // namespace ols
