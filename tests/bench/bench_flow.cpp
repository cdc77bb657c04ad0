// SPDX-License-Identifier: MIT
// Optical flow: methods side by side on clean scenes and through the camera's noise, and what Brox's settings cost.
// links: ols_flow ols_bench_photographs
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "../unit/flow_scenes.hpp"
#include "bench.hpp"
#include "flow/flow.hpp"
#include "photographs.hpp"

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

cv::Mat to_8_bit(const Image& image, float brightest) {
    cv::Mat out;
    cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()))
        .convertTo(out, CV_8U, 255.0 / double(brightest));
    return out;
}

FlowField field_of(const cv::Mat& vectors) {
    FlowField flow(vectors.cols, vectors.rows);
    std::vector<cv::Mat> planes = {cv::Mat(vectors.rows, vectors.cols, CV_32F, flow.u.data()),
                                   cv::Mat(vectors.rows, vectors.cols, CV_32F, flow.v.data())};
    cv::split(vectors, planes);
    return flow;
}

// Farneback, "Two-frame motion estimation based on polynomial expansion" (SCIA 2003), with the settings of OpenCV's samples.
FlowField farneback(const FlowScene& scene) {
    const float brightest = std::ranges::max(scene.from.data);
    cv::Mat vectors;
    cv::calcOpticalFlowFarneback(to_8_bit(scene.from, brightest), to_8_bit(scene.to, brightest), vectors, 0.5, 5, 15, 3,
                                 7, 1.5, 0);
    return field_of(vectors);
}

// OpenCV's DIS and nothing else, for what our call costs beside it: of images that are 8 bits already, by an object that is kept, vectors left as
// OpenCV lays them out.
class OwnDis {
  public:
    OwnDis(const std::vector<FlowScene>& scenes, int preset)
        : scenes_(scenes), dis_(cv::DISOpticalFlow::create(preset)) {
        for (const FlowScene& scene : scenes) {
            const float brightest = std::ranges::max(scene.from.data);
            images_.push_back({to_8_bit(scene.from, brightest), to_8_bit(scene.to, brightest)});
        }
    }
    void run(size_t scene) { dis_->calc(images_[scene].first, images_[scene].second, vectors_); }
    double error() {
        double sum = 0;
        for (size_t scene = 0; scene < scenes_.size(); ++scene) {
            run(scene);
            sum += endpoint_error(field_of(vectors_), scenes_[scene]);
        }
        return sum / double(scenes_.size());
    }

  private:
    const std::vector<FlowScene>& scenes_;
    cv::Ptr<cv::DISOpticalFlow> dis_;
    std::vector<std::pair<cv::Mat, cv::Mat>> images_;
    cv::Mat vectors_;
};

Setting own_dis(const std::string& name, const std::vector<FlowScene>& scenes, int preset) {
    const auto own = std::make_shared<OwnDis>(scenes, preset);
    return {name, [own] { own->run(0); }, [own] { return own->error(); }};
}

std::vector<Setting> all_methods(const std::vector<FlowScene>& scenes) {
    std::vector<Setting> settings = {own_dis("OpenCV's DIS ultrafast", scenes, cv::DISOpticalFlow::PRESET_ULTRAFAST),
                                     own_dis("OpenCV's DIS fast", scenes, cv::DISOpticalFlow::PRESET_FAST),
                                     own_dis("OpenCV's DIS medium", scenes, cv::DISOpticalFlow::PRESET_MEDIUM)};
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

// Errors of a hand that passes and of lips that move differ by a factor of forty: each pair counts by its ratio.
double geometric_mean_error(const Estimate& estimate, const std::vector<FlowScene>& pairs) {
    double sum = 0;
    for (const FlowScene& pair : pairs) sum += std::log(endpoint_error(estimate(pair), pair));
    return std::exp(sum / double(pairs.size()));
}

FlowField no_flow(const FlowScene& scene) {
    return FlowField(scene.from.width, scene.from.height);
}

std::vector<Setting> on_photographs(const std::vector<FlowScene>& pairs, const std::vector<std::string>& names) {
    std::vector<Setting> settings;
    for (const std::string& name : names) {
        const Estimate estimate = name == "none" ? no_flow : by_options(*flow_method(name));
        settings.push_back({name, [&pairs, estimate] { static_cast<void>(estimate(pairs[0])); },
                            [&pairs, estimate] { return geometric_mean_error(estimate, pairs); }});
    }
    return settings;
}

void measure_photographs(Bench& bench, int width, int height) {
    std::vector<std::vector<FlowScene>> pairs(photograph_names().size());
    std::vector<FlowScene> all;
    for (size_t i = 0; bench.measures() && i < pairs.size(); ++i) {
        auto taken = bench.full() ? photographed(i, width, height) : tiny_pair(width, height);
        if (!taken) {
            std::fprintf(stderr, "bench_flow: %s\n", taken.error().message.c_str());
            std::exit(1);
        }
        all.push_back(*taken);
        pairs[i].push_back(std::move(*taken));
    }
    const std::string by = "FlowOptions::method, flow_method(name)";
    bench.measure({.name = "method, photographs",
                   .set_by = by,
                   .error_unit = "px, geometric mean",
                   .peer = "dis-medium",
                   .default_setting = "brox",
                   .settings = on_photographs(all, flow_method_names())});
    for (size_t i = 0; i < pairs.size(); ++i)
        bench.measure(
            {.name = photograph_names()[i],
             .set_by = by,
             .error_unit = "px",
             .peer = "dis-medium",
             .default_setting = "brox",
             .settings = on_photographs(pairs[i], {"none", "dis-medium", "brox-half", "brox", "brox-fine", "robust"}),
             .table = "endpoint error on photographs, px",
             .table_note = "**Photographs, pair by pair.** `none` is the motion itself.",
             .most_rounds = 1});
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
                  "four scenes. Photographs: eight pairs of the moving scenes of [motion_scenes.md](motion_scenes.md) "
                  "under a smooth "
                  "environment, coded by the power 1/2.2 and rounded to 8 bits, without other noise; six are 8 ms "
                  "apart, two 42; "
                  "the geometric mean of the eight. The time is that of one flow of "
                  "640 x 480 on one core.",
         .advice = "Take `brox`: half the error of DIS medium on clean textures, two thirds on photographs, somewhat "
                   "less through noise, for about "
                   "its time. `robust` errs less on clean synthetic textures alone: on photographs, even without "
                   "noise, and through the "
                   "camera's noise it errs more, and takes half as long again. `brox-fine` is for what passes fast "
                   "before something else, "
                   "`brox-quick` and `brox-half` are for preview, `refine` for a flow that is nearly right. "
                   "docs/motion.md says what each is."});
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
                   .why_off_front =
                       "`robust` errs less on these textures, but more on photographs and through the camera's noise.",
                   .settings = all_methods(clean)});
    bench.measure({.name = "method, camera noise",
                   .set_by = by,
                   .error_unit = "px mean",
                   .peer = "dis-medium",
                   .default_setting = "brox",
                   .settings = all_methods(noise)});
    measure_photographs(bench, width, height);
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
