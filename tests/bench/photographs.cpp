// SPDX-License-Identifier: MIT
// Two renderings, one coding, and the geometry's flow.
#include "photographs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "render/renderer.hpp"
#include "render/true_flow.hpp"

namespace ols {

namespace {

// When a scene is photographed: in the middle of its motion.
struct Moments {
    std::string scene;
    double from_us, apart_us;
};

constexpr double next_us = 1e6 / 120, half_a_cycle_us = 5 * next_us;
constexpr size_t hair = 1;

const std::vector<Moments> all_moments = {{"spin", 200000, next_us},           {"hair", 200000, next_us},
                                          {"turn180", 200000, next_us},        {"hand", 180000, next_us},
                                          {"turn60", 200000, next_us},         {"talk", 60000, next_us},
                                          {"turn60", 100000, half_a_cycle_us}, {"talk", 60000, half_a_cycle_us}};

// A smooth environment: bright from the upper right, some light from everywhere.
float weight_of(Vec3 direction) {
    const Vec3 bright = {0.49, 0.78, 0.39};  // of length 1
    const double cosine = direction.x * bright.x + direction.y * bright.y + direction.z * bright.z;
    return float(0.25 + std::pow(std::max(cosine, 0.0), 2));
}

Image luminance(const Image& color) {
    Image out(color.width, color.height, 1);
    for (size_t p = 0; p < out.data.size(); ++p)
        out.data[p] = 0.2126f * color.data[3 * p] + 0.7152f * color.data[3 * p + 1] + 0.0722f * color.data[3 * p + 2];
    return out;
}

// What a thousandth of the picture lies above.
double white_of(const Image& image) {
    std::vector<float> values = image.data;
    const auto white = values.end() - 1 - std::ptrdiff_t(values.size() / 1000);
    std::nth_element(values.begin(), white, values.end());
    return double(*white);
}

void code(Image& image, double white) {
    for (float& value : image.data)
        value = float(std::round(255 * std::pow(std::clamp(double(value) / white, 0.0, 1.0), 1 / 2.2)));
}

Result<scenes::FlowScene> photograph(const Moments& moments, int width, int height) {
    auto scene = read_scene("tools/stagesim/scenes/motion_" + moments.scene + ".toml");
    if (!scene) return scene.error();
    StageConfig stage = default_stage();
    CameraConfig& camera = stage.cameras[0];
    camera.width = width, camera.height = height;
    Renderer renderer({*scene, stage, camera, false}, {});
    std::vector<Float3> weights(renderer.lamp_count());
    for (size_t lamp = 0; lamp < stage.lamps.size(); ++lamp) {
        const float weight = weight_of(stage.lamps[lamp].direction);
        weights[lamp] = {weight, weight, weight};
    }
    const double to_us = moments.from_us + moments.apart_us;
    TrueFlow truth = true_flow(*scene, camera, moments.from_us, to_us);
    scenes::FlowScene out{moments.scene, luminance(renderer.light(weights, moments.from_us)),
                          luminance(renderer.light(weights, to_us)), std::move(truth.flow), std::move(truth.visible)};
    const double white = white_of(out.from);
    code(out.from, white);
    code(out.to, white);
    return out;
}

}  // namespace

const std::vector<std::string>& photograph_names() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> made;
        for (const Moments& one : all_moments)
            made.push_back(fmt::format("{}, {:.0f} ms apart", one.scene, one.apart_us / 1000));
        return made;
    }();
    return names;
}

Result<scenes::FlowScene> photographed(size_t which, int width, int height) {
    return photograph(all_moments[which], width, height);
}

Result<scenes::FlowScene> tiny_pair(int width, int height) {
    return photograph(all_moments[hair], width, height);
}

}  // namespace ols
