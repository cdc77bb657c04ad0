// SPDX-License-Identifier: MIT
// Foretelling by a small rendering, scaled by pixels.
#include "run/plan.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

using nlohmann::json;

constexpr int reduction = 6;

json effects_json(const EffectSet& effects) {
    json rows = json::array();
    for (const auto& row : effects.rows())
        rows.push_back({{"name", row.name},
                        {"caller", row.caller},
                        {"active", row.active()},
                        {"disabled", row.disabled},
                        {"evaluation", row.evaluation},
                        {"evaluations", row.evaluations}});
    return rows;
}

bool is_sensor_effect(const std::string& name) {
    return name == "vignetting" || name == "noise" || name == "quantisation";
}

std::string count_text(double n) {
    if (n >= 1e9) return fmt::format("{:.2f} G", n / 1e9);
    if (n >= 1e6) return fmt::format("{:.1f} M", n / 1e6);
    if (n >= 1e4) return fmt::format("{:.0f} k", n / 1e3);
    return fmt::format("{:.0f}", n);
}

}  // namespace

json foretell(const Setup& setup, const std::set<std::string>& disabled) {
    CameraConfig small_camera = setup.camera;
    small_camera.width = std::max(16, setup.camera.width / reduction);
    small_camera.height = std::max(12, setup.camera.height / reduction);
    const Setup small{setup.scene, setup.stage, small_camera, setup.camera_model};
    Renderer renderer(small, disabled);

    const std::vector<double> lit_us(renderer.lamp_count(), 1);
    renderer.expose(lit_us, 0, 0, 0);
    const double before_sums = renderer.cost().sums_s, before_sensor = renderer.cost().sensor_s;
    renderer.expose(lit_us, 0, 1, 0);
    const Cost& cost = renderer.cost();

    const double by_pixels =
        double(setup.camera.width) * setup.camera.height / (small_camera.width * small_camera.height);
    json plan = {{"effects", effects_json(renderer.effects())},
                 {"primary_rays", uint64_t(setup.camera.width) * setup.camera.height * setup.scene.samples},
                 {"lamp_points", uint64_t(double(cost.lamp_points) * by_pixels)},
                 {"moving", renderer.effects().movement() != nullptr}};
    for (json& effect : plan["effects"]) {
        const std::string name = effect["name"];
        // Two exposures were made, one is foretold.
        const double scale = name == "motion" ? 1 : is_sensor_effect(name) ? by_pixels / 2 : by_pixels;
        effect["evaluations"] = uint64_t(double(effect["evaluations"]) * scale);
    }
    const double sums = (cost.sums_s - before_sums) * by_pixels / 2;
    plan["seconds"] = {{"build", cost.build_s},
                       {"visibility", cost.visibility_s * by_pixels},
                       {"lamps", cost.lamps_s * by_pixels},
                       {"exposure", sums + (cost.sensor_s - before_sensor) * by_pixels}};
    return plan;
}

json account(const Renderer& renderer) {
    const Cost& cost = renderer.cost();
    const double exposures = std::max<double>(1, double(cost.exposures));
    return {{"effects", effects_json(renderer.effects())},
            {"primary_rays", cost.primary_rays},
            {"lamp_points", cost.lamp_points},
            {"placings", cost.placings},
            {"exposures", cost.exposures},
            {"seconds",
             {{"build", cost.build_s},
              {"visibility", cost.visibility_s},
              {"lamps", cost.lamps_s},
              {"exposure", (cost.sums_s + cost.sensor_s) / exposures},
              {"sums", cost.sums_s},
              {"sensor", cost.sensor_s}}}};
}

std::string plan_text(const json& foretold, const json& actual) {
    const bool ran = !actual.is_null();
    const double exposures = ran ? double(actual["exposures"]) : 1;
    std::string text = fmt::format("{:<13}{:>10}{}  {:<24} {}\n", "effect", "foretold", ran ? "    actual" : "",
                                   "evaluation", "called for by");
    for (size_t i = 0; i < foretold["effects"].size(); ++i) {
        const json& effect = foretold["effects"][i];
        const std::string caller = effect["caller"];
        const std::string reason = caller.empty()             ? "nobody"
                                   : bool(effect["disabled"]) ? "(disabled) " + caller
                                                              : caller;
        const std::string name = effect["name"];
        const double foretold_count = double(effect["evaluations"]) * (is_sensor_effect(name) ? exposures : 1);
        text += fmt::format("{:<13}{:>10}", name, count_text(foretold_count));
        if (ran) text += fmt::format("{:>10}", count_text(actual["effects"][i]["evaluations"]));
        text += fmt::format("  {:<24} {}\n", effect["evaluation"].get<std::string>(), reason);
    }
    const auto line = [&](const char* what, const char* key) {
        text += fmt::format("{:<40}{:>9.3f} s", what, foretold["seconds"][key].get<double>());
        if (ran) text += fmt::format("{:>9.3f} s", actual["seconds"][key].get<double>());
        text += '\n';
    };
    const bool moving = foretold["moving"];
    line("building the ray hierarchy", "build");
    line(moving ? "visibility, each time the scene moved" : "visibility, once", "visibility");
    line(moving ? "all lamps, each time the scene moved" : "all lamps, once", "lamps");
    line("an exposure with half of the lamps", "exposure");
    if (ran)
        text += fmt::format("{} exposures, scene placed {} times\n", actual["exposures"].get<uint64_t>(),
                            actual["placings"].get<uint64_t>());
    return text;
}

}  // namespace ols
