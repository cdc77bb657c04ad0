// SPDX-License-Identifier: MIT
// rf weights: how much light each lamp gives for an environment, for other programs to use.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "archive/archive.hpp"
#include "lighting.hpp"
#include "program.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct Options {
    std::string archive, lights_file;
    LightingOptions lighting;
    bool json = false;
};

Result<std::vector<LightPosition>> lights_of(const Options& options) {
    if (!options.archive.empty()) {
        const auto archive = ArchiveReader::open(options.archive);
        if (!archive) return archive.error();
        return archive->info().lights;
    }
    if (!options.lights_file.empty()) return read_lp(options.lights_file);
    std::vector<LightPosition> lights;
    for (Vec3 direction : stage_lamp_directions())
        lights.push_back({fmt::format("lamp_{:03}", lights.size()), direction});
    return lights;
}

void print_table(const std::vector<LightPosition>& lights, const SphereCells& cells, const Lighting& lighting) {
    fmt::print("{:<16} {:>9} {:>9} {:>9} {:>11} {:>9}  {:>11} {:>11} {:>11}\n", "lamp", "x", "y", "z", "cell_sr",
               "reach_deg", "red", "green", "blue");
    for (int i = 0; i < cells.size(); ++i) {
        const Vec3 d = cells.directions()[i];
        const Rgb& w = lighting.weights.irradiance[i];
        fmt::print("{:<16} {:>9.6f} {:>9.6f} {:>9.6f} {:>11.6f} {:>9.2f}  {:>11.6g} {:>11.6g} {:>11.6g}\n",
                   lights[i].name, d.x, d.y, d.z, cells.solid_angle(i), cells.reach(i) * 180 / std::numbers::pi, w[0],
                   w[1], w[2]);
    }
}

nlohmann::json weights_json(const std::vector<LightPosition>& lights, const SphereCells& cells,
                            const Lighting& lighting) {
    nlohmann::json lamps = nlohmann::json::array();
    for (int i = 0; i < cells.size(); ++i) {
        const Vec3 d = cells.directions()[i];
        lamps.push_back({{"name", lights[i].name},
                         {"direction", {d.x, d.y, d.z}},
                         {"solid_angle_sr", cells.solid_angle(i)},
                         {"reach_deg", cells.reach(i) * 180 / std::numbers::pi},
                         {"irradiance", lighting.weights.irradiance[i]}});
    }
    nlohmann::json report = lighting.report;
    report["lamps"] = lamps;
    return report;
}

Status run(const Options& options) {
    const auto lights = lights_of(options);
    if (!lights) return lights.error();
    const auto cells = cells_of_lights(*lights);
    if (!cells) return cells.error();
    const auto lighting = make_lighting(options.lighting, *cells);
    if (!lighting) return lighting.error();
    for (const auto& warning : lighting->warnings) fmt::print(stderr, "rf weights: {}\n", warning);
    if (options.json)
        print_json(weights_json(*lights, *cells, *lighting));
    else
        print_table(*lights, *cells, *lighting);
    return Done{};
}

}  // namespace

void add_weights_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("weights", "print the irradiance each lamp gives for an environment");
    verb->footer(
        "Example: rf weights --env sunset.exr --rotate 90 --json\n"
        "Without --lights or an archive, the 156 lamps of the stage are used.");
    auto* archive = verb->add_option("archive", options->archive, "take.rfa, for its lights");
    verb->add_option("--lights", options->lights_file, "light positions (.lp)")->excludes(archive);
    options->lighting.add_to(*verb);
    verb->add_flag("--json", options->json, "print JSON");
    verb->callback([options, &exit_code] {
        const auto status = run(*options);
        if (status) return;
        fmt::print(stderr, "rf weights: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols
