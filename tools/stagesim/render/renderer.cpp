// SPDX-License-Identifier: MIT
// Keeps the lamp images of the scene's current pose: a still scene is shaded once, a moving one whenever it moved.
#include "render/renderer.hpp"

#include <algorithm>
#include <chrono>

namespace ols {

namespace {

// Adds the seconds of its life to a sum.
class Stopwatch {
  public:
    explicit Stopwatch(double& sum) : sum_(sum) {}
    ~Stopwatch() { sum_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

  private:
    double& sum_;
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

Renderer::Renderer(const Setup& setup, const std::set<std::string>& disabled)
    : setup_(setup), effects_(setup, disabled), lamps_(place_lamps(setup.stage, setup.scene)) {
    if (setup.scene.texture_step_m > 0) baked_ = std::make_unique<BakedLooks>(setup.scene, setup.scene.texture_step_m);
}

void Renderer::place(double time_us) {
    // Nobody moves, or motion is disabled: the scene stays as it is at time 0.
    if (!effects_.movement()) time_us = 0;
    {
        const Stopwatch stopwatch(cost_.build_s);
        if (!geometry_)
            geometry_ = std::make_unique<Geometry>(setup_.scene, time_us);
        else if (!geometry_->place(time_us))
            return;
    }
    images_.reset();
    sums_.forget();
    const Stopwatch stopwatch(cost_.visibility_s);
    const CameraConfig& camera = setup_.camera;
    VisiblePoints points =
        find_visible_points(setup_.scene, *geometry_, Pinhole(camera), camera.width, camera.height, baked_.get());
    ++cost_.placings;
    cost_.primary_rays += uint64_t(camera.width) * camera.height * setup_.scene.samples;
    cost_.visible_points = points.size();
    if (effects_.movement()) effects_.movement()->count(1);
    for (LightEffect* effect : effects_.arriving()) effect->prepare(points, lamps_, *geometry_);
    for (LightEffect* effect : effects_.reflecting()) effect->prepare(points, lamps_, *geometry_);
    images_ = std::make_unique<LampImages>(std::move(points), lamps_.size(), channels());
}

void Renderer::forget_light() {
    if (images_) images_->forget();
    sums_.forget();
}

void Renderer::render(const std::vector<uint32_t>& lamps) {
    const Stopwatch stopwatch(cost_.lamps_s);
    for (const uint32_t lamp : lamps)
        if (!images_->has(lamp)) cost_.lamp_points += images_->points().size();
    images_->render(lamps, lamps_, *geometry_, effects_);
}

Image Renderer::light(const std::vector<Float3>& weights, double time_us) {
    place(time_us);
    if (const Image* sum = sums_.find(weights)) return *sum;
    std::vector<uint32_t> lit;
    for (uint32_t i = 0; i < lamps_.size(); ++i)
        if (!(weights[i] == Float3{})) lit.push_back(i);
    render(lit);
    const Stopwatch stopwatch(cost_.sums_s);
    Image sum(setup_.camera.width, setup_.camera.height, channels());
    images_->add_weighted(weights, sum);
    sums_.remember(weights, sum);
    return sum;
}

Exposure Renderer::expose(const std::vector<double>& lit_us, double time_us, uint64_t number, uint32_t camera) {
    std::vector<Float3> weights;
    for (const double t : lit_us) {
        const float counts = float(t * setup_.camera.counts_per_us);
        weights.push_back({counts, counts, counts});
    }
    Exposure exposure{light(weights, time_us), camera, number};
    const Stopwatch stopwatch(cost_.sensor_s);
    for (SensorEffect* effect : effects_.sensor()) effect->apply(exposure);
    ++cost_.exposures;
    return exposure;
}

void Renderer::render_all_lamps(const std::function<void(double)>& progress) {
    constexpr uint32_t batch = 12;
    place(0);
    for (uint32_t first = 0; first < lamps_.size(); first += batch) {
        std::vector<uint32_t> lamps;
        for (uint32_t i = first; i < std::min<size_t>(lamps_.size(), first + batch); ++i) lamps.push_back(i);
        render(lamps);
        progress(double(first + lamps.size()) / double(lamps_.size()));
    }
}

}  // namespace ols
