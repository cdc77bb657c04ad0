// SPDX-License-Identifier: MIT
// Optical flow: methods side by side on clean scenes and through the camera's noise, and what Brox's settings cost.
// links: ols_flow
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "../unit/flow_scenes.hpp"
#include "bench.hpp"
#include "flow/flow.hpp"

using namespace ols;
using namespace ols::scenes;

namespace {

// None of these textures and motions served to tune a method: they were drawn when all settings were fixed.
std::vector<FlowScene> reported_scenes(int width, int height) {
    const Motion turn = similarity(-1.5, 1.015, -1.2, 2.1, width / 2.0, height / 2.0);
    const Motion front = similarity(0, 1, -3.6, 2.2, 0, 0), back = similarity(0, 1, 1.3, 0.7, 0, 0);
    return {ball_scene("head turning at 60 degrees/s", width, height, value_noise(301, 5), 0.5),
            ball_scene("head turning at 180 degrees/s", width, height, value_noise(302, 6), 1.5),
            plane_scene("rotation and zoom", width, height, waves(303), turn),
            layers_scene("hand before face", width, height, value_noise(304, 6), front, value_noise(305, 5), back,
                         height / 4.0)};
}

using Estimate = std::function<FlowField(const FlowScene&)>;

// One setting: it is timed on the first scene, and errs on all.
Setting setting(const std::string& name, const Estimate& estimate, const std::vector<FlowScene>& scenes) {
    return {name, [&scenes, estimate] { static_cast<void>(estimate(scenes[0])); },
            [&scenes, estimate] {
                double sum = 0;
                for (const FlowScene& scene : scenes) sum += endpoint_error(estimate(scene), scene);
                return sum / double(scenes.size());
            }};
}

Estimate by_options(const FlowOptions& options) {
    return [options](const FlowScene& scene) { return *estimate_flow(scene.from, scene.to, options); };
}

// Farneback, "Two-frame motion estimation based on polynomial expansion" (SCIA 2003), with the settings of OpenCV's samples.
FlowField farneback(const FlowScene& scene) {
    constexpr double to_8_bit = 255 / brightest;
    cv::Mat from, to, vectors;
    const auto counts = [](const Image& image) {
        return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
    };
    counts(scene.from).convertTo(from, CV_8U, to_8_bit);
    counts(scene.to).convertTo(to, CV_8U, to_8_bit);
    cv::calcOpticalFlowFarneback(from, to, vectors, 0.5, 5, 15, 3, 7, 1.5, 0);
    FlowField flow(from.cols, from.rows);
    std::vector<cv::Mat> planes = {cv::Mat(from.rows, from.cols, CV_32F, flow.u.data()),
                                   cv::Mat(from.rows, from.cols, CV_32F, flow.v.data())};
    cv::split(vectors, planes);
    return flow;
}

std::vector<Setting> all_methods(const std::vector<FlowScene>& scenes) {
    std::vector<Setting> settings;
    for (const std::string& name : flow_method_names())
        settings.push_back(setting(name, by_options(*flow_method(name)), scenes));
    const std::vector<std::pair<std::string, FlowOptions>> more = {
        {"dis-medium, full resolution", {DisFlowOptions{.finest_scale = 0}}},
        {"brox, 1 warp at the finest", {BroxFlowOptions{.finest_warps = 1}}},
        {"robust, 1 stage", {RobustFlowOptions{.stages = 1}}},
        {"robust, 3 stages", {RobustFlowOptions{.stages = 3}}}};
    for (const auto& [name, options] : more) settings.push_back(setting(name, by_options(options), scenes));
    settings.push_back(setting("Farneback", farneback, scenes));
    return settings;
}

// Of flows that miss by what half resolution leaves.
std::vector<Setting> all_refinements(const std::vector<FlowScene>& scenes, const std::vector<FlowField>& given) {
    std::vector<Setting> settings = {setting("brox, nothing given", by_options(*flow_method("brox")), scenes)};
    const auto given_for = [&](const FlowScene& scene) -> const FlowField& {
        return given[size_t(&scene - &scenes[0])];
    };
    settings.push_back(setting("the given flow as it is", given_for, scenes));
    for (const std::string& name : flow_refinement_names())
        settings.push_back(setting(
            name,
            [given_for, options = *flow_method(name)](const FlowScene& scene) {
                return *estimate_flow(scene.from, scene.to, options, &given_for(scene));
            },
            scenes));
    return settings;
}

std::vector<Setting> pyramid_ratios(const std::vector<FlowScene>& scenes) {
    const std::vector<std::pair<std::string, double>> ratios = {{"0.5", 0.5}, {"0.8", 0.8}, {"0.95", 0.95}};
    std::vector<Setting> settings;
    for (const auto& [name, ratio] : ratios)
        settings.push_back(setting(name, by_options({BroxFlowOptions{.ratio = ratio}}), scenes));
    return settings;
}

}  // namespace

int main(int argc, char** argv) {
    require_freed_planes("bench_flow");
    cv::setNumThreads(1);
    Bench bench(
        argc, argv,
        {.name = "flow",
         .truth = "Analytic textures under motions in closed form, 12-bit counts: a ball that turns by 0.5 and by 1.5 "
                  "degrees "
                  "between frames (60 and 180 degrees/s at 120 Hz), rotation with zoom, a disc that passes before a "
                  "plane; none "
                  "served to tune a method. The error is the mean endpoint error over what both frames show, the mean "
                  "of the "
                  "four scenes; the time is that of one flow of 640 x 480 on one core.",
         .advice =
             "Take `brox`: half the error of DIS medium without noise, somewhat less with it, for about its time. "
             "`robust` errs least where there is little noise; `brox-quick` and `brox-half` are for preview, "
             "`refine` for a flow that is nearly right. docs/motion.md says what each is."});
    const int width = bench.full() ? 640 : 96, height = bench.full() ? 480 : 64;
    const std::vector<FlowScene> clean = reported_scenes(width, height);
    std::vector<FlowScene> noise;
    for (size_t i = 0; i < clean.size(); ++i) noise.push_back(noisy(clean[i], unsigned(200 + 2 * i)));
    const std::string by = "FlowOptions::method, flow_method(name)";
    bench.measure(
        {.name = "method, clean",
         .set_by = by,
         .error_unit = "px mean",
         .peer = "dis-medium",
         .default_setting = "brox",
         .why_off_front =
             "`robust` errs less where there is no noise, but every camera has some, and there `brox` errs less.",
         .settings = all_methods(clean)});
    bench.measure({.name = "method, camera noise",
                   .set_by = by,
                   .error_unit = "px mean",
                   .peer = "dis-medium",
                   .default_setting = "brox",
                   .settings = all_methods(noise)});
    bench.measure({.name = "pyramid ratio of brox, camera noise",
                   .set_by = "BroxFlowOptions::ratio",
                   .error_unit = "px mean",
                   .peer = "0.95",
                   .default_setting = "0.5",
                   .settings = pyramid_ratios(noise)});
    std::vector<FlowField> given;
    for (const FlowScene& scene : noise) given.push_back(by_options(*flow_method("brox-half"))(scene));
    bench.measure({.name = "refinement of a flow of brox-half, camera noise",
                   .set_by = by,
                   .error_unit = "px mean",
                   .peer = "brox, nothing given",
                   .default_setting = "refine",
                   .settings = all_refinements(noise, given)});
    return bench.finish();
}
