// SPDX-License-Identifier: MIT
// The options by which the verbs of rf are told what light to use: an environment map, point lights, or both.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "relight/lamp_weights.hpp"
#include "result.hpp"

namespace ols {

struct LightingOptions {
    std::string environment;  // path; empty for none
    std::string convention;   // empty: as the file says
    ExrChoice picture;        // which of an OpenEXR file's pictures is the map
    double rotate_deg = 0;
    double exposure_ev = 0;
    std::vector<std::string> lights;  // "x y z r g b"

    void add_to(CLI::App& verb);
};

struct Lighting {
    LampWeights weights;
    nlohmann::json report;              // what was used, for --json
    std::vector<std::string> warnings;  // one line each
};

// Reads the map and shares it and the point lights out among the lamps. Errors: no light given, a map that cannot be
// read, a point light that is not six numbers or has no direction.
Result<Lighting> make_lighting(const LightingOptions& options, const SphereCells& cells);

// The cells of a list of lights; errors name the two lights that share a direction.
Result<SphereCells> cells_of_lights(const std::vector<LightPosition>& lights);

}  // namespace ols
