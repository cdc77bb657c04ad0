// SPDX-License-Identifier: MIT
// The default stage, and stage.toml.
#include "stage/stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "stage/camera_presets.hpp"
#include "stage/toml_section.hpp"
#include "wire.h"

namespace ols {

namespace {

// Six lamps on arms in front of the 60 x 40 cm matte board, which hangs half a metre behind the subject (Wenger 3.2):
// three above and three below the camera's view, turned towards the board.
std::vector<Vec3> default_matte_lamps() {
    std::vector<Vec3> places;
    for (const double y : {0.32, -0.32})
        for (const double x : {-0.25, 0.0, 0.25}) places.push_back({x, y, -0.35});
    return places;
}

constexpr double far_m = 1000;  // from the stage's centre: single precision still tells 0.1 mm apart there
constexpr size_t cameras_max = 64, matte_lamps_max = OLS_CHAIN_BITS_MAX;

std::vector<int> identity_chain(int lamps) {
    std::vector<int> bits(lamps);
    for (int i = 0; i < lamps; ++i) bits[i] = i;
    return bits;
}

void read_lamps(TomlSection lamps, StageConfig& stage) {
    std::string lp;
    lamps.read("lp", lp);
    if (!lp.empty()) {
        const auto lights = read_lp(lamps.resolve_path(lp));
        if (lights.ok()) {
            std::vector<Vec3> directions;
            for (const auto& light : *lights) directions.push_back(light.direction);
            stage.lamps = named_lamps(directions);
        } else {
            lamps.reject("lp", "cannot be used: " + lights.error().message);
        }
    }
    lamps.read("radius_m", stage.radius_m, 0.05, 100);
    lamps.read("beam_exponent", stage.lamp_beam_exponent, 0, 1000);
    lamps.read("on_delay_us", stage.lamp_response.on_delay_us, 0, 1000);
    lamps.read("off_delay_us", stage.lamp_response.off_delay_us, 0, 1000);
    lamps.read("rise_us", stage.lamp_response.rise_us, 0, 1000);
    lamps.read("fall_us", stage.lamp_response.fall_us, 0, 1000);
    if (!lamps.has("matte")) return;
    stage.matte_lamps_m.clear();
    for (auto& place : lamps.sections("matte", matte_lamps_max)) {
        std::array<double, 3> position_m{};
        if (!place.has("position_m")) place.reject("position_m", "is missing");
        place.read("position_m", position_m, -far_m, far_m);
        stage.matte_lamps_m.push_back({position_m[0], position_m[1], position_m[2]});
    }
}

// A stage of more lamps than a chain has bits is fine to render; check_chain() says so where a board is to play it.
void read_chain(TomlSection chain, StageConfig& stage) {
    const bool is_given = chain.has("bits") || chain.has("bit_of_lamp");
    if (!is_given && stage.lamp_count() > OLS_CHAIN_BITS_MAX) {
        stage.chain_bits = 0;
        stage.chain_bit_of_lamp.clear();
        return;
    }
    if (!is_given) stage.chain_bits = std::max(stage.chain_bits, stage.lamp_count());
    chain.read("bits", stage.chain_bits, 1, OLS_CHAIN_BITS_MAX);
    stage.chain_bit_of_lamp = identity_chain(stage.lamp_count());
    chain.read("bit_of_lamp", stage.chain_bit_of_lamp, 0, stage.chain_bits - 1);
    const auto& bits = stage.chain_bit_of_lamp;
    if (int(bits.size()) != stage.lamp_count())
        chain.reject("bit_of_lamp", fmt::format("lists {} bits for {} lamps (sphere lamps first, then the matte "
                                                "board's): list one for each",
                                                bits.size(), stage.lamp_count()));
    if (std::set<int>(bits.begin(), bits.end()).size() != bits.size())
        chain.reject("bit_of_lamp", "gives two lamps the same bit");
    for (const int bit : bits)
        if (bit >= stage.chain_bits)
            return chain.reject("bits", fmt::format("is {}, but a lamp sits on bit {}", stage.chain_bits, bit));
}

// What a preset knows; the keys beside it may say otherwise.
void read_preset(TomlSection& camera, CameraConfig& config) {
    std::map<std::string, CameraPreset> presets;
    for (const auto& preset : camera_presets()) presets[preset.name] = preset;
    CameraPreset chosen{"", "", config.bits, config.noise};
    camera.read_choice("preset", chosen, presets);
    config.bits = chosen.bits;
    config.noise = chosen.noise;
}

Vec3 to_vec3(const std::array<double, 3>& a) {
    return {a[0], a[1], a[2]};
}

// Where the camera stands and looks: the view and `up` must span a plane.
void read_view(TomlSection& camera, CameraConfig& config) {
    camera.read("position_m", config.position_m, -far_m, far_m);
    camera.read("look_at_m", config.look_at_m, -far_m, far_m);
    camera.read_direction("up", config.up);
    camera.read("vertical_fov_deg", config.vertical_fov_deg, 0.1, 170);
    const Vec3 view = to_vec3(config.look_at_m) - to_vec3(config.position_m), up = to_vec3(config.up);
    if (length(view) < 1e-3)
        return camera.reject("look_at_m", "is where the camera stands: look at a place 1 mm or more from position_m");
    if (length(cross(view, up)) < 1e-6 * length(view) * length(up))
        camera.reject("up", "is parallel to the view from position_m to look_at_m: choose another direction");
}

CameraConfig read_camera(TomlSection& camera) {
    CameraConfig config;
    read_preset(camera, config);
    camera.read("source", config.source);
    camera.read("width", config.width, 8, 16384);
    camera.read("height", config.height, 8, 16384);
    camera.read_choice<Cfa>("cfa", config.cfa,
                            {{"none", Cfa::none},
                             {"rggb", Cfa::rggb},
                             {"bggr", Cfa::bggr},
                             {"grbg", Cfa::grbg},
                             {"gbrg", Cfa::gbrg},
                             {"rgb", Cfa::rgb}});
    camera.read("bits", config.bits, 8, 16);
    config.white = double((1 << config.bits) - 1);
    camera.read("black", config.black, 0, config.white);
    camera.read("white", config.white, 1, double((1 << config.bits) - 1));
    if (config.black >= config.white) camera.reject("black", "must be below white");
    camera.read("noise_read_counts", config.noise.read_counts, 0, 1000);
    camera.read("noise_shot", config.noise.shot, 0, 1000);
    camera.read("trigger", config.trigger, 0, 3);
    camera.read("trigger_source", config.trigger_source);
    camera.read_choice<TriggerActivation>(
        "trigger_activation", config.trigger_activation,
        {{"rising_edge", TriggerActivation::rising_edge}, {"falling_edge", TriggerActivation::falling_edge}});
    camera.read("trigger_delay_us", config.trigger_delay_us, 0, 1e6);
    camera.read_choice<ExposureMode>("exposure_mode", config.exposure_mode,
                                     {{"trigger_width", ExposureMode::trigger_width}, {"timed", ExposureMode::timed}});
    camera.read("exposure_us", config.exposure_us, 0.1, 1e6);
    camera.read("controls", config.controls);
    read_view(camera, config);
    camera.read("vignetting", config.vignetting, 0, 1);
    camera.read("counts_per_us", config.counts_per_us, 1e-6, 1e6);
    return config;
}

}  // namespace

StageConfig default_stage() {
    StageConfig stage;
    stage.lamps = named_lamps();
    stage.matte_lamps_m = default_matte_lamps();
    stage.chain_bit_of_lamp = identity_chain(stage.lamp_count());
    stage.cameras.emplace_back();
    return stage;
}

Result<StageConfig> read_stage(const std::string& path) {
    auto file = TomlSection::open(path);
    if (!file.ok()) return file.error();
    StageConfig stage = default_stage();
    read_lamps(file->section("lamps"), stage);
    read_chain(file->section("chain"), stage);
    file->section("board").read("link", stage.board);
    stage.gpio = read_gpio(file->section("gpio"));
    if (file->has("telemetry")) stage.telemetry = read_telemetry(file->section("telemetry"), stage.chain_bits);
    stage.daemon = read_daemon(file->section("daemon"));
    stage.daemon.is_there = file->has("daemon");
    file->read("calibration", stage.calibration_dir);
    if (!stage.calibration_dir.empty()) stage.calibration_dir = file->resolve_path(stage.calibration_dir);
    if (file->has("camera")) {
        stage.cameras.clear();
        for (auto& camera : file->sections("camera", cameras_max)) stage.cameras.push_back(read_camera(camera));
    }
    if (const Status status = file->finish(); !status.ok()) return status.error();
    return stage;
}

Status check_chain(const StageConfig& stage) {
    if (int(stage.chain_bit_of_lamp.size()) >= stage.lamp_count()) return Done{};
    return fail(
        fmt::format("the stage has {} lamps and a board's chain drives {}: such a stage can be rendered (`stagesim "
                    "render`), not played",
                    stage.lamp_count(), OLS_CHAIN_BITS_MAX));
}

}  // namespace ols
