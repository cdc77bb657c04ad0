// SPDX-License-Identifier: MIT
// Optical flow: methods side by side on clean scenes and through the camera's noise, and what Brox's settings cost.
// links: ols_reflectance
#include <malloc.h>

#include <opencv2/core.hpp>

#include "../unit/flow_scenes.hpp"
#include "bench.hpp"
#include "reflectance/flow.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

// None of these textures and motions served to tune a method.
std::vector<FlowScene> reported_scenes(int width, int height) {
    const Motion turn = similarity(1.2, 1.02, 1.5, -0.8, width / 2.0, height / 2.0);
    const Motion front = similarity(0, 1, 4, 1.5, 0, 0), back = similarity(0, 1, -1.5, 0.5, 0, 0);
    return {ball_scene("head turning at 60 degrees/s", width, height, value_noise(101, 5), 0.5),
            ball_scene("head turning at 180 degrees/s", width, height, value_noise(102, 7), 1.5),
            plane_scene("rotation and zoom", width, height, waves(103), turn),
            layers_scene("hand before face", width, height, value_noise(104, 5), front, value_noise(105, 6), back,
                         height / 4.0)};
}

// One setting: it is timed on the first scene, and errs on all.
Setting setting(const std::string& name, const FlowOptions& options, const std::vector<FlowScene>& scenes) {
    return {name, [&scenes, options] { static_cast<void>(estimate_flow(scenes[0].from, scenes[0].to, options).ok()); },
            [&scenes, options] {
                double sum = 0;
                for (const FlowScene& scene : scenes)
                    sum += endpoint_error(*estimate_flow(scene.from, scene.to, options), scene);
                return sum / double(scenes.size());
            }};
}

std::vector<Setting> all_methods(const std::vector<FlowScene>& scenes) {
    std::vector<Setting> settings;
    for (const std::string& name : flow_method_names()) settings.push_back(setting(name, *flow_method(name), scenes));
    return settings;
}

}  // namespace

int main(int argc, char** argv) {
    // Freed planes stay with the process, as in one that estimates flow after flow: else half of the time goes to fresh pages.
    mallopt(M_MMAP_THRESHOLD, 1 << 28);
    mallopt(M_TRIM_THRESHOLD, 1 << 29);
    cv::setNumThreads(1);
    Bench bench(
        argc, argv,
        {.name = "flow",
         .truth =
             "Analytic textures under motions in closed form, 12-bit counts: a ball that turns by 0.5 and by 1.5 "
             "degrees "
             "between frames (60 and 180 degrees/s at 120 Hz), rotation with zoom, a disc that passes before a plane. "
             "The error is the mean endpoint error over what both frames show, the mean of the four scenes; the time "
             "is "
             "that of one flow of 640 x 480 on one core.",
         .advice = "Take `brox`: it errs less than half as much as DIS medium for little more time. `brox-half` is for "
                   "preview, "
                   "`dis-fast` for a glance; `robust` keeps motion boundaries sharpest."});
    const int width = bench.full() ? 640 : 96, height = bench.full() ? 480 : 64;
    const std::vector<FlowScene> clean = reported_scenes(width, height);
    std::vector<FlowScene> noise;
    for (size_t i = 0; i < clean.size(); ++i) noise.push_back(noisy(clean[i], unsigned(200 + 2 * i)));
    const std::string by = "FlowOptions::method, flow_method(name)";
    bench.measure({.name = "method, clean",
                   .set_by = by,
                   .error_unit = "px mean",
                   .peer = "dis-medium",
                   .default_setting = "brox",
                   .settings = all_methods(clean)});
    bench.measure({.name = "method, camera noise",
                   .set_by = by,
                   .error_unit = "px mean",
                   .peer = "dis-medium",
                   .default_setting = "brox",
                   .settings = all_methods(noise)});
    std::vector<Setting> ratios;
    for (const double ratio : {0.5, 0.8, 0.95}) {
        BroxFlowOptions options;
        options.ratio = ratio;
        ratios.push_back(setting(ratio == 0.5 ? "0.5" : ratio == 0.8 ? "0.8" : "0.95", {.method = options}, noise));
    }
    bench.measure({.name = "pyramid ratio of brox, camera noise",
                   .set_by = "BroxFlowOptions::ratio",
                   .error_unit = "px mean",
                   .peer = "0.95",
                   .default_setting = "0.5",
                   .settings = ratios});
    return bench.finish();
}
