// SPDX-License-Identifier: MIT
// Environment maps and point lights from the command line to lamp weights.
#include "lighting.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <sstream>

namespace ols {

namespace {

constexpr double degree = std::numbers::pi / 180;

Result<PointLight> parse_light(const std::string& text) {
    std::istringstream words(text);
    words.imbue(std::locale::classic());
    PointLight light{};
    std::string rest;
    auto& [d, c] = light;
    const bool six = bool(words >> d.x >> d.y >> d.z >> c[0] >> c[1] >> c[2]) && !(words >> rest);
    if (!six) return fail("--light '" + text + "' is not six numbers: write \"x y z r g b\"");
    if (!(length(d) > 0)) return fail("--light '" + text + "' has no direction: x y z must not all be 0");
    return light;
}

Status add_environment(const LightingOptions& options, const SphereCells& cells, Lighting& lighting) {
    std::optional<EnvConvention> convention;
    if (!options.convention.empty()) {
        const auto parsed = parse_env_convention(options.convention);
        if (!parsed) return parsed.error();
        convention = *parsed;
    }
    const auto environment = read_environment(options.environment, convention, options.picture);
    if (!environment) return environment.error();
    lighting.weights = integrate_environment(
        *environment, cells, {.rotate_rad = options.rotate_deg * degree, .exposure_ev = options.exposure_ev});
    lighting.report["environment"] = {{"file", options.environment},
                                      {"width", environment->radiance.width},
                                      {"height", environment->radiance.height},
                                      {"rotate_deg", options.rotate_deg},
                                      {"clamped_negative_texels", environment->clamped_negative},
                                      {"clamped_non_finite_texels", environment->clamped_non_finite},
                                      {"warnings", environment->warnings}};
    for (const auto& warning : environment->warnings)
        lighting.warnings.push_back(fmt::format("{}: {}", options.environment, warning));
    return Done{};
}

}  // namespace

void LightingOptions::add_to(CLI::App& verb) {
    verb.add_option("--env", environment, "environment map (.exr, .hdr)")->type_name("MAP");
    verb.add_option("--env-convention", convention,
                    "openexr: latitude-longitude, +Z in the middle, +X left of it (default); mirrored: +X right of it; "
                    "angular: angular probe, -Z in the middle")
        ->type_name("NAME");
    verb.add_option("--part", picture.part, "part of a map of several, by name or number")->type_name("NAME");
    verb.add_option("--layer", picture.layer, "layer of a map of several: \"beauty\" for beauty.R ...")
        ->type_name("NAME");
    verb.add_option("--rotate", rotate_deg, "turn the map about +Y; 90 moves light from the camera (+Z) to +X")
        ->type_name("DEG")
        ->check(CLI::Range(-3600.0, 3600.0));
    verb.add_option("--exposure", exposure_ev, "all light times 2^EV")->type_name("EV")->check(CLI::Range(-64.0, 64.0));
    verb.add_option("--light", lights,
                    "a point light from direction x y z, given to the lamp nearest to it; r g b is its irradiance over "
                    "pi: colour 1 1 1 shows that lamp's image as it is; repeatable")
        ->type_name("\"x y z r g b\"")
        ->allow_extra_args(false);
}

Result<Lighting> make_lighting(const LightingOptions& options, const SphereCells& cells) {
    if (options.environment.empty() && options.lights.empty())
        return fail("no light is given: add --env MAP or --light \"x y z r g b\"");
    Lighting lighting;
    lighting.weights.irradiance.assign(cells.size(), Rgb{});
    lighting.report["exposure_ev"] = options.exposure_ev;
    if (!options.environment.empty()) {
        const auto added = add_environment(options, cells, lighting);
        if (!added) return added.error();
    }
    for (const std::string& text : options.lights) {
        auto light = parse_light(text);
        if (!light) return light.error();
        for (double& v : light->color) v *= std::exp2(options.exposure_ev);
        const int lamp = add_point_light(*light, cells, lighting.weights);
        const double cosine = dot(normalized(light->direction), cells.directions()[lamp]);
        lighting.report["point_lights"].push_back(
            {{"light", text}, {"lamp", lamp}, {"angle_to_lamp_deg", std::acos(std::min(cosine, 1.0)) / degree}});
    }
    for (const Rgb& w : lighting.weights.irradiance)
        for (double v : w)
            if (!(std::abs(v) < std::numeric_limits<float>::max()))
                return fail("the light is brighter than single precision holds: lower --exposure or the map's values");
    return lighting;
}

Result<SphereCells> cells_of_lights(const std::vector<LightPosition>& lights) {
    std::vector<Vec3> directions;
    directions.reserve(lights.size());
    for (const auto& light : lights) directions.push_back(light.direction);
    return SphereCells::make(directions);
}

}  // namespace ols
