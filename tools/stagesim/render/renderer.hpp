// SPDX-License-Identifier: MIT
// One camera's pictures of a scene: linear light for any mixture of lamps at any time, and exposures through the sensor.
#pragma once

#include <functional>
#include <memory>
#include <set>

#include "render/lamp_images.hpp"
#include "render/light_sums.hpp"

namespace ols {

// What rendering took, for `plan`.
struct Cost {
    uint64_t placings = 0;  // of the scene: 1 for a still one
    uint64_t primary_rays = 0;
    uint64_t visible_points = 0;  // of the last placing
    uint64_t lamp_points = 0;     // visible points times lamps shaded
    uint64_t exposures = 0;
    double build_s = 0, visibility_s = 0, lamps_s = 0, sums_s = 0, sensor_s = 0;
};

class Renderer {
  public:
    // The setup's scene, stage and camera must outlive the renderer.
    Renderer(const Setup& setup, const std::set<std::string>& disabled);

    // Sum over lamps of weight * r image (pi L / E; white facing the lamp at the stage centre is 1) at a time of the
    // scene; channels() channels, zero where nothing is. `weights` has one entry a lamp.
    Image light(const std::vector<Float3>& weights, double time_us);

    // Exposes each lamp for `lit_us[lamp]` microseconds at `time_us` and passes the light through lens and sensor.
    Exposure expose(const std::vector<double>& lit_us, double time_us, uint64_t number, uint32_t camera);

    // Shades every lamp of a still scene now, so that exposures cost only sums; `progress` gets 0 to 1.
    void render_all_lamps(const std::function<void(double)>& progress);

    // Lets go of what was rendered of lamps. It is rendered anew when it is asked for, the same to the bit.
    void forget_light();

    // Poses the scene as it is at a time and finds what is seen of it, as every picture does by itself. Done beforehand, the first
    // picture of a moving scene need not make its looks as well, which takes as long as several pictures.
    void place(double time_us);

    int channels() const { return effects_.mosaic() ? 1 : 3; }
    size_t lamp_count() const { return lamps_.size(); }
    const EffectSet& effects() const { return effects_; }
    const Cost& cost() const { return cost_; }

  private:
    void render(const std::vector<uint32_t>& lamps);

    Setup setup_;
    EffectSet effects_;
    std::vector<PlacedLamp> lamps_;
    std::unique_ptr<Geometry> geometry_;
    std::unique_ptr<BakedLooks> baked_;   // where the scene asks for it
    std::unique_ptr<LampImages> images_;  // of the geometry as it is placed
    LightSums sums_{size_t(768) << 20};   // a cycle of 180 pictures of 640 x 480 in colour
    Cost cost_;
};

}  // namespace ols
