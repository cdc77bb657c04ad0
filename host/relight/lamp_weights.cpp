// SPDX-License-Identifier: MIT
// Integrals of environment maps over the lamps' cells.
#include "relight/lamp_weights.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

namespace ols {

namespace {

// Shares the solid angle of one patch after the other out among the lamps.
class PatchSharer {
  public:
    PatchSharer(const SphereCells& cells, EnvConvention convention, const EnvironmentOptions& options)
        : cells_(cells),
          convention_(convention),
          tolerance_(options.border_tolerance_rad),
          cos_(std::cos(options.rotate_rad)),
          sin_(std::sin(options.rotate_rad)) {
        assert(tolerance_ > 0);
    }

    // Calls add(lamp, steradians) for every part of the patch.
    template <typename Add>
    void share(const EnvPatch& patch, const Add& add) {
        const double mid_u = (patch.u0 + patch.u1) / 2, mid_v = (patch.v0 + patch.v1) / 2;
        const Vec3 middle = rotated(env_direction(convention_, mid_u, mid_v));
        // Neighbouring patches mostly lie in the same cell, so the walk to the nearest lamp starts where it last ended.
        lamp_ = cells_.nearest(middle, lamp_);
        const double reach = env_reach(convention_, patch);
        const auto [border_rad, across] = closest_border(lamp_, middle);
        if (border_rad > reach) {
            add(lamp_, env_solid_angle(convention_, patch));
            return;
        }
        if (reach <= tolerance_) {
            // The border cuts this part: as much of it lies across as of a line from rim to rim.
            const double steradians = env_solid_angle(convention_, patch), beyond = (1 - border_rad / reach) / 2;
            add(lamp_, steradians * (1 - beyond));
            add(across, steradians * beyond);
            return;
        }
        share({patch.u0, mid_u, patch.v0, mid_v}, add);
        share({mid_u, patch.u1, patch.v0, mid_v}, add);
        share({patch.u0, mid_u, mid_v, patch.v1}, add);
        share({mid_u, patch.u1, mid_v, patch.v1}, add);
    }

  private:
    Vec3 rotated(Vec3 d) const { return {cos_ * d.x + sin_ * d.z, d.y, cos_ * d.z - sin_ * d.x}; }

    struct Border {
        double distance_rad;
        int across;
    };

    // The great circle of the cell's border that is closest to a direction inside the cell.
    Border closest_border(int lamp, Vec3 direction) const {
        double smallest = std::numeric_limits<double>::infinity();
        int across = lamp;
        for (const auto& neighbor : cells_.neighbors(lamp)) {
            const double sine = dot(direction, neighbor.normal);
            if (sine < smallest) smallest = sine, across = neighbor.lamp;
        }
        if (across == lamp) return {smallest, lamp};
        return {std::asin(std::clamp(smallest, 0.0, 1.0)), across};
    }

    const SphereCells& cells_;
    EnvConvention convention_;
    double tolerance_, cos_, sin_;
    int lamp_ = 0;
};

}  // namespace

LampWeights integrate_environment(const Environment& environment, const SphereCells& cells,
                                  const EnvironmentOptions& options) {
    LampWeights weights{std::vector<Rgb>(cells.size(), Rgb{})};
    PatchSharer sharer(cells, environment.convention, options);
    const Image& map = environment.radiance;
    const double gain = std::exp2(options.exposure_ev);
    for (int y = 0; y < map.height; ++y) {
        for (int x = 0; x < map.width; ++x) {
            const Rgb radiance = {gain * map.at(x, y, 0), gain * map.at(x, y, 1), gain * map.at(x, y, 2)};
            if (radiance == Rgb{}) continue;
            const EnvPatch texel = {double(x) / map.width, double(x + 1) / map.width, double(y) / map.height,
                                    double(y + 1) / map.height};
            sharer.share(texel, [&](int lamp, double steradians) {
                for (int c = 0; c < 3; ++c) weights.irradiance[lamp][c] += radiance[c] * steradians;
            });
        }
    }
    return weights;
}

double share_of_light(const LampWeights& weights, const std::vector<int>& lamps) {
    const auto light = [&](int lamp) {
        const Rgb& w = weights.irradiance[lamp];
        return w[0] + w[1] + w[2];
    };
    double all = 0, some = 0;
    for (int lamp = 0; lamp < int(weights.irradiance.size()); ++lamp) all += light(lamp);
    for (int lamp : lamps) some += light(lamp);
    return all > 0 ? some / all : 0;
}

int add_point_light(const PointLight& light, const SphereCells& cells, LampWeights& weights) {
    const int lamp = cells.nearest(light.direction);
    for (int c = 0; c < 3; ++c) weights.irradiance[lamp][c] += std::numbers::pi * light.color[c];
    return lamp;
}

}  // namespace ols
