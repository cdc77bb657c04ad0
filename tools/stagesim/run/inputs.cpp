// SPDX-License-Identifier: MIT
// Reads scene and stage for the verbs.
#include "run/inputs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "render/effects/effect_set.hpp"

namespace ols {

void add_input_options(CLI::App& verb, InputOptions& options) {
    verb.add_option("scene", options.scene, "scene file, such as tools/stagesim/scenes/head.toml")->required();
    verb.add_option("--stage", options.stage, "stage.toml: lamps and cameras; the default stage without it");
    verb.add_option("--camera", options.camera, "which camera of the stage, from 0");
    verb.add_option("--disable-effect", options.disabled, "leave an effect out; may be given several times")
        ->check(CLI::IsMember(effect_names()));
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
