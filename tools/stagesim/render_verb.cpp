// SPDX-License-Identifier: MIT
// stagesim render: pictures of a scene without sensor and noise, the truth that recorded takes are held against.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "image/exr.hpp"
#include "image/input_file.hpp"
#include "image/json_object.hpp"
#include "image/outputs.hpp"
#include "image/png.hpp"
#include "image/tone.hpp"
#include "program.hpp"
#include "relight/lamp_weights.hpp"
#include "render/effects/vignetting.hpp"
#include "render/renderer.hpp"
#include "run/inputs.hpp"
#include "verbs.hpp"

namespace ols {

namespace {

struct RenderOptions {
    InputOptions inputs;
    std::vector<int> lamps;
    bool all_lamps = false, olat = false, json = false;
    std::string weights, env, env_convention, unit = "reflectance", out, png;
    ExrChoice env_picture;
    double rotate_deg = 0, exposure_ev = 0, time_us = 0, png_gain = 1;
};

constexpr double weight_max = 1e6;
constexpr uint64_t weights_bytes_max = 16 << 20;

// A number or three of them, within weight_max.
std::optional<Float3> weight_of(const nlohmann::json& entry) {
    std::array<float, 3> rgb;
    if (entry.is_array() && entry.size() != 3) return std::nullopt;
    for (size_t c = 0; c < 3; ++c) {
        const nlohmann::json& value = entry.is_array() ? entry[c] : entry;
        if (!value.is_number() || !(std::abs(value.get<double>()) <= weight_max)) return std::nullopt;
        rgb[c] = value.get<float>();
    }
    return Float3{rgb[0], rgb[1], rgb[2]};
}

// `{"weights": [w, ...]}` or `{"weights": [[r, g, b], ...]}`, one for each lamp from 0; the rest is dark.
Result<std::vector<Float3>> read_weights(const std::string& path, size_t lamps) {
    const auto text = read_input(path, "weights", weights_bytes_max);
    if (!text) return text.error();
    const auto json = parse_json(*text, "'" + path + "'");
    if (!json) return json.error();
    const Error wrong =
        fail(fmt::format("'{}' must hold {{\"weights\": [...]}} and nothing else, with at most {} numbers "
                         "or [r, g, b] from {} to {}",
                         path, lamps, -weight_max, weight_max));
    if (!json->is_object() || json->size() != 1 || !json->contains("weights") || !(*json)["weights"].is_array())
        return wrong;
    const nlohmann::json& entries = (*json)["weights"];
    if (entries.size() > lamps) return wrong;
    std::vector<Float3> weights(lamps);
    for (size_t i = 0; i < entries.size(); ++i) {
        const auto weight = weight_of(entries[i]);
        if (!weight) return wrong;
        weights[i] = *weight;
    }
    return weights;
}

// What `rf relight` gives a lamp: its share of the environment over pi.
Result<std::vector<Float3>> environment_weights(const RenderOptions& options, const StageConfig& stage,
                                                std::vector<std::string>& warnings) {
    std::optional<EnvConvention> convention;
    if (!options.env_convention.empty()) {
        const auto parsed = parse_env_convention(options.env_convention);
        if (!parsed) return parsed.error();
        convention = *parsed;
    }
    const auto environment = read_environment(options.env, convention, options.env_picture);
    if (!environment) return environment.error();
    for (const auto& warning : environment->warnings) {
        warnings.push_back(options.env + ": " + warning);
        fmt::print(stderr, "stagesim render: {}\n", warnings.back());
    }
    std::vector<Vec3> directions;
    for (const LightPosition& lamp : stage.lamps) directions.push_back(lamp.direction);
    const auto cells = SphereCells::make(directions);
    if (!cells) return cells.error();
    const LampWeights weights =
        integrate_environment(*environment, *cells, {options.rotate_deg * std::numbers::pi / 180, options.exposure_ev});
    std::vector<Float3> result(stage.lamp_count());
    for (size_t i = 0; i < weights.irradiance.size(); ++i) {
        const Rgb& w = weights.irradiance[i];
        result[i] = Float3{float(w[0]), float(w[1]), float(w[2])} * std::numbers::inv_pi_v<float>;
    }
    return result;
}

Result<std::vector<Float3>> chosen_weights(const RenderOptions& options, const StageConfig& stage,
                                           std::vector<std::string>& warnings) {
    const size_t count = size_t(stage.lamp_count());
    if (!options.env.empty()) return environment_weights(options, stage, warnings);
    if (!options.weights.empty()) return read_weights(options.weights, count);
    std::vector<Float3> weights(count);
    if (options.all_lamps)
        std::fill(weights.begin(), weights.begin() + std::ptrdiff_t(stage.lamps.size()), Float3{1, 1, 1});
    for (const int lamp : options.lamps) {
        if (lamp < 0 || size_t(lamp) >= count)
            return fail(fmt::format("--lamps: there is no lamp {}: the stage has 0 to {}", lamp, count - 1));
        weights[lamp] = {1, 1, 1};
    }
    return weights;
}

// r units as they are; counts a microsecond have gain and vignetting, as the camera sees them.
void to_unit(Image& image, const RenderOptions& options, const CameraConfig& camera) {
    if (options.unit == "reflectance") return;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const float factor = float(camera.counts_per_us) *
                                 Vignetting::factor(float(camera.vignetting), x, y, image.width, image.height);
            for (int c = 0; c < 3; ++c) image.at(x, y, c) *= factor;
        }
}

Status write_picture(const RenderOptions& options, Image image, const CameraConfig& camera, const std::string& path) {
    to_unit(image, options, camera);
    if (!path.empty())
        if (const Status s = write_exr(path, image, ExrType::single_float, {{"unit", options.unit}}); !s) return s;
    if (options.png.empty()) return Done{};
    for (float& v : image.data) v *= float(options.png_gain);
    return write_png_preview(options.png, image);
}

std::string lamp_file(const RenderOptions& options, size_t lamp) {
    return fmt::format("{}/lamp_{:03}.exr", options.out, lamp);
}

std::string lights_file(const RenderOptions& options) {
    return options.out + "/lights.lp";
}

// The pictures of the sphere's lamps with their lights: the folder is then ready for `stagectl ingest`.
Status write_lights(const RenderOptions& options, const StageConfig& stage) {
    std::vector<LightPosition> lights;
    for (size_t lamp = 0; lamp < stage.lamps.size(); ++lamp)
        lights.push_back(
            {std::filesystem::path(lamp_file(options, lamp)).filename().string(), stage.lamps[lamp].direction});
    return write_lp(lights_file(options), lights);
}

Status render_olat(const RenderOptions& options, Renderer& renderer, const CameraConfig& camera) {
    for (size_t lamp = 0; lamp < renderer.lamp_count(); ++lamp) {
        std::vector<Float3> weights(renderer.lamp_count());
        weights[lamp] = {1, 1, 1};
        const Status written =
            write_picture(options, renderer.light(weights, options.time_us), camera, lamp_file(options, lamp));
        if (!written) return written;
        renderer.forget_light();  // a thousand lamps' images would not fit
        show_progress("lamps", double(lamp + 1) / double(renderer.lamp_count()));
    }
    return Done{};
}

Status make_folder(const std::string& path) {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error) return fail("cannot make folder '" + path + "': " + error.message());
    return Done{};
}

Status check_files(const RenderOptions& options, size_t lamps) {
    Outputs outputs{.inputs = {options.inputs.scene, options.inputs.stage, options.weights, options.env}};
    if (options.olat) {
        for (size_t lamp = 0; lamp < lamps; ++lamp) outputs.files.push_back(lamp_file(options, lamp));
        outputs.files.push_back(lights_file(options));
    } else {
        outputs.exr = {options.out}, outputs.png = {options.png};
    }
    return check_outputs(outputs);
}

nlohmann::json report(const RenderOptions& options, const Inputs& inputs, size_t lamps,
                      const std::vector<std::string>& warnings) {
    nlohmann::json report = {{"output", options.out},          {"png", options.png},   {"width", inputs.camera.width},
                             {"height", inputs.camera.height}, {"unit", options.unit}, {"at_us", options.time_us}};
    if (options.olat) {
        report["pictures"] = lamps;
        report["lights"] = lights_file(options);
    }
    report["warnings"] = warnings;
    return report;
}

Status render(const RenderOptions& options) {
    const auto inputs = read_inputs(options.inputs);
    if (!inputs) return inputs.error();
    const size_t lamps = size_t(inputs->stage.lamp_count());
    if (options.olat)
        if (const Status made = make_folder(options.out); !made) return made;
    if (const Status writable = check_files(options, lamps); !writable) return writable;
    std::vector<std::string> warnings;
    const auto weights =
        options.olat ? Result(std::vector<Float3>()) : chosen_weights(options, inputs->stage, warnings);
    if (!weights) return weights.error();
    // Linear light: no sensor; gain and vignetting come with --unit counts.
    Renderer renderer(inputs->setup(false), options.inputs.disabled_set());
    const Status done =
        options.olat ? render_olat(options, renderer, inputs->camera)
                     : write_picture(options, renderer.light(*weights, options.time_us), inputs->camera, options.out);
    if (done && options.olat)
        if (const Status listed = write_lights(options, inputs->stage); !listed) return listed;
    if (done && options.json) print_json(report(options, *inputs, lamps, warnings));
    return done;
}

}  // namespace

void add_render_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<RenderOptions>();
    CLI::App* verb = app.add_subcommand("render", "render a scene without sensor and noise");
    verb->footer(
        fmt::format("Units: reflectance is pi L / E, 1 for white facing a lamp at the stage centre; counts are the "
                    "camera's counts a microsecond, with vignetting.\nPNG: {}.\n"
                    "Example: stagesim render tools/stagesim/scenes/head.toml --lamps 0,5 -o two.exr",
                    tone_curve_text));
    add_input_options(*verb, options->inputs);
    auto* light = verb->add_option_group("light", "which lamps are on");
    light->add_option("--lamps", options->lamps, "these lamps, each at 1")->delimiter(',');
    light->add_flag("--all-lamps", options->all_lamps, "every lamp of the sphere at 1");
    light->add_option("--weights", options->weights, "JSON file {\"weights\": [w or [r, g, b], ...]}");
    light->add_option("--env", options->env, "environment map (.exr, .hdr): lamps weighted as `rf relight` does");
    auto* olat = light->add_flag(
        "--olat", options->olat,
        "one picture a lamp, into the folder of -o, and lights.lp: the directions of the sphere's lamps");
    light->require_option(1);
    verb->add_option("--env-convention", options->env_convention, "openexr, mirrored or angular");
    verb->add_option("--part", options->env_picture.part, "part of an environment map of several, by name or number");
    verb->add_option("--layer", options->env_picture.layer, "layer of an environment map of several");
    verb->add_option("--rotate", options->rotate_deg,
                     "turn the environment about +Y, degrees: light from +Z moves to +X")
        ->check(number_from(-36000.0, 36000.0));
    verb->add_option("--exposure", options->exposure_ev, "stops, of the environment")
        ->check(number_from(-100.0, 100.0));
    verb->add_option("--at-us,--time-us", options->time_us, "moment of a moving scene")
        ->check(number_from(-1e12, 1e12));
    verb->add_option("--unit", options->unit, "of the EXR")->check(CLI::IsMember({"reflectance", "counts"}));
    verb->add_option("-o,--out", options->out, "EXR file (a folder with --olat), 32-bit float");
    verb->add_option("--png", options->png, "preview file, of one picture")->excludes(olat);
    verb->add_option("--png-gain", options->png_gain, "factor before the preview's tone curve")
        ->check(number_from(0.0, 1e9));
    verb->add_flag("--json", options->json, "print what was written as JSON");
    verb->callback([options, &exit_code] {
        const Status status = options->out.empty() && options->png.empty()
                                  ? Status(fail("nothing to write: give -o FILE.exr or --png FILE.png"))
                                  : render(*options);
        if (status) return;
        fmt::print(stderr, "stagesim render: {}\n", status.error().message);
        exit_code = 1;
    });
}

}  // namespace ols
