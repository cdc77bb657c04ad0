// SPDX-License-Identifier: MIT
// Reads scene and stage for the verbs.
#include "run/inputs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "render/effects/effect_set.hpp"

namespace ols {

CLI::Validator number_from(double min, double max) {
    const auto check = [min, max](const std::string& word) {
        double value = 0;
        const bool is_inside = CLI::detail::lexical_cast(word, value) && value >= min && value <= max;
        return is_inside ? std::string() : fmt::format("'{}' is no number from {} to {}", word, min, max);
    };
    return CLI::Validator(check, fmt::format("FLOAT in [{} - {}]", min, max));
}

void add_input_options(CLI::App& verb, InputOptions& options) {
    verb.add_option("scene", options.scene, "scene file, such as tools/stagesim/scenes/head.toml")->required();
    verb.add_option("--stage", options.stage, "stage.toml: lamps and cameras; the default stage without it");
    verb.add_option("--camera", options.camera, "which camera of the stage, from 0");
    verb.add_option("--disable-effect", options.disabled, "leave an effect out; may be given several times")
        ->check(CLI::IsMember(effect_names()));
}

// A picture of all that the camera sees, before anything is taken for it: some bytes for each sample, twice while tiles are put
// together, and for each pixel.
static Status check_memory(const Inputs& inputs) {
    constexpr double sample_bytes = 2 * 160, pixel_bytes = 64;
    const double pixels = double(inputs.camera.width) * inputs.camera.height;
    const double needed = pixels * (inputs.scene.samples * sample_bytes + pixel_bytes);
    const double present = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGESIZE));
    if (needed <= present) return Done{};
    return fail(
        fmt::format("{} x {} pixels of {} samples may take {:.0f} GB, and this machine has {:.0f}: make the "
                    "camera's width and height in stage.toml, or samples in the scene, smaller",
                    inputs.camera.width, inputs.camera.height, inputs.scene.samples, needed / 1e9, present / 1e9));
}

// The matte board's lamps aim at its middle.
static Status check_board(const Inputs& inputs) {
    if (!inputs.scene.board) return Done{};
    for (const Vec3 lamp : inputs.stage.matte_lamps_m)
        if (length(lamp - inputs.scene.board->center_m) < 1e-3)
            return fail(
                fmt::format("the scene's board has its center_m where the stage has a matte lamp, at ({}, {}, {}) m: "
                            "move one of them",
                            lamp.x, lamp.y, lamp.z));
    return Done{};
}

Result<Inputs> read_inputs(const InputOptions& options) {
    Inputs inputs;
    inputs.stage = default_stage();
    if (!options.stage.empty()) {
        auto stage = read_stage(options.stage);
        if (!stage) return stage.error();
        inputs.stage = std::move(*stage);
    }
    if (options.camera < 0 || size_t(options.camera) >= inputs.stage.cameras.size())
        return fail(fmt::format("--camera {}: the stage has cameras 0 to {}", options.camera,
                                int(inputs.stage.cameras.size()) - 1));
    inputs.camera = inputs.stage.cameras[options.camera];
    auto scene = read_scene(options.scene);
    if (!scene) return scene.error();
    inputs.scene = std::move(*scene);
    for (const std::string& note : inputs.scene.notes) fmt::print(stderr, "stagesim: {}: {}\n", options.scene, note);
    if (const Status fits = check_memory(inputs); !fits) return fits.error();
    if (const Status fits = check_board(inputs); !fits) return fits.error();
    return inputs;
}

void show_progress(const char* what, double done) {
    if (!isatty(STDERR_FILENO)) return;
    const int filled = int(30 * done);
    std::fprintf(stderr, "\r%-12s [%-30s] %3.0f %%%s", what, std::string(filled, '#').c_str(), 100 * done,
                 done >= 1 ? "\n" : "");
    std::fflush(stderr);
}

}  // namespace ols
