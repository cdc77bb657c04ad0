// SPDX-License-Identifier: MIT
// Pairs of images whose flow is known in closed form: analytic textures under analytic motions, in counts of a 12-bit camera.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "flow/flow_field.hpp"
#include "image/frame.hpp"

namespace ols::scenes {

struct FlowScene {
    std::string name;
    Image from, to;
    FlowField truth;
    std::vector<unsigned char> scored;  // 1 where the pixel of `from` is textured and visible in `to`
};

using Texture = std::function<double(double, double)>;  // 0..1 of a position in pixels

// Twenty plane waves, 7 to 60 pixels long.
inline Texture waves(unsigned seed) {
    struct Wave {
        double kx, ky, phase, amplitude;
    };
    std::mt19937 random(seed);
    const auto unit = [&] { return double(random()) / 4294967296.0; };
    std::vector<Wave> all;
    double total = 0;
    for (int i = 0; i < 20; ++i) {
        const double length = 7 * std::pow(60.0 / 7, unit()), angle = 2 * M_PI * unit(), amplitude = std::sqrt(length);
        all.push_back(
            {2 * M_PI / length * std::cos(angle), 2 * M_PI / length * std::sin(angle), 2 * M_PI * unit(), amplitude});
        total += amplitude;
    }
    return [all, total](double x, double y) {
        double sum = 0;
        for (const Wave& w : all) sum += w.amplitude * std::sin(w.kx * x + w.ky * y + w.phase);
        return 0.5 + 0.9 * sum / total;
    };
}

// Value noise: random values on lattices, the finest of `finest` pixels, interpolated by quintics; amplitude falls with pitch.
inline Texture value_noise(unsigned seed, double finest, int octaves = 5) {
    const auto lattice = [seed](int64_t x, int64_t y, int octave) {
        uint64_t h = uint64_t(x) * 0x9e3779b97f4a7c15u ^ uint64_t(y) * 0xc2b2ae3d27d4eb4fu ^
                     (uint64_t(seed) << 8 | uint64_t(octave)) * 0x165667b19e3779f9u;
        h = (h ^ h >> 31) * 0xbf58476d1ce4e5b9u;
        h = (h ^ h >> 29) * 0x94d049bb133111ebu;
        return double((h ^ h >> 32) & 0xffffff) / 0xffffff;
    };
    return [lattice, finest, octaves](double x, double y) {
        double sum = 0, total = 0;
        for (int o = 0; o < octaves; ++o) {
            const double pitch = finest * std::pow(2.0, o), amplitude = std::sqrt(pitch);
            const double px = x / pitch, py = y / pitch, ix = std::floor(px), iy = std::floor(py);
            const auto ease = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
            const double tx = ease(px - ix), ty = ease(py - iy);
            const auto at = [&](int dx, int dy) { return lattice(int64_t(ix) + dx, int64_t(iy) + dy, o); };
            sum += amplitude *
                   ((1 - ty) * ((1 - tx) * at(0, 0) + tx * at(1, 0)) + ty * ((1 - tx) * at(0, 1) + tx * at(1, 1)));
            total += amplitude;
        }
        return sum / total;
    };
}

struct Motion {
    std::function<std::array<double, 2>(double, double)> forward, backward;  // positions in pixels
};

// x -> scale R(angle) (x - centre) + centre + shift
inline Motion similarity(double angle_deg, double scale, double shift_x, double shift_y, double cx, double cy) {
    const double a = angle_deg * M_PI / 180, c = std::cos(a), s = std::sin(a);
    return {[=](double x, double y) -> std::array<double, 2> {
                const double dx = x - cx, dy = y - cy;
                return {scale * (c * dx - s * dy) + cx + shift_x, scale * (s * dx + c * dy) + cy + shift_y};
            },
            [=](double x, double y) -> std::array<double, 2> {
                const double dx = (x - cx - shift_x) / scale, dy = (y - cy - shift_y) / scale;
                return {c * dx + s * dy + cx, -s * dx + c * dy + cy};
            }};
}

constexpr double darkest = 100, brightest = 2000;  // counts

// The whole image under one motion.
inline FlowScene plane_scene(const std::string& name, int width, int height, const Texture& texture,
                             const Motion& motion) {
    FlowScene scene{name, Image(width, height, 1), Image(width, height, 1), FlowField(width, height),
                    std::vector<unsigned char>(size_t(width) * size_t(height))};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const size_t at = size_t(y) * size_t(width) + size_t(x);
            const auto [bx, by] = motion.backward(x, y);
            const auto [fx, fy] = motion.forward(x, y);
            scene.from.data[at] = float(darkest + (brightest - darkest) * texture(x, y));
            scene.to.data[at] = float(darkest + (brightest - darkest) * texture(bx, by));
            scene.truth.u[at] = float(fx - x);
            scene.truth.v[at] = float(fy - y);
            scene.scored[at] = fx >= 0 && fy >= 0 && fx <= width - 1 && fy <= height - 1;
        }
    return scene;
}

// A disc of one texture moving before a plane of another, both edges blended over a pixel.
inline FlowScene layers_scene(const std::string& name, int width, int height, const Texture& front,
                              const Motion& front_motion, const Texture& back, const Motion& back_motion,
                              double radius) {
    FlowScene scene = plane_scene(name, width, height, back, back_motion);
    const double cx = width / 2.0, cy = height / 2.0;
    const auto cover = [&](double x, double y) {
        return std::clamp(radius + 0.5 - std::hypot(x - cx, y - cy), 0.0, 1.0);
    };
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const size_t at = size_t(y) * size_t(width) + size_t(x);
            const auto [bx, by] = front_motion.backward(x, y);
            const auto [fx, fy] = front_motion.forward(x, y);
            const double here = cover(x, y), there = cover(bx, by);
            scene.from.data[at] += float(here * (darkest + (brightest - darkest) * front(x, y) - scene.from.data[at]));
            scene.to.data[at] += float(there * (darkest + (brightest - darkest) * front(bx, by) - scene.to.data[at]));
            if (here >= 0.5) {
                scene.truth.u[at] = float(fx - x);
                scene.truth.v[at] = float(fy - y);
            } else {  // the background is seen in `to` where the disc does not come to stand before it
                const auto [sx, sy] = front_motion.backward(x + scene.truth.u[at], y + scene.truth.v[at]);
                if (cover(sx, sy) > 0) scene.scored[at] = 0;
            }
        }
    return scene;
}

// A ball before black, turning about its vertical axis, seen orthographically; evenly lit: brightness falls by a third towards
// its rim, with the surface's slope. A stand-in for a head: what it shows slides over its outline. Scored is what is seen at a slope
// that leaves two pixels to a texture lattice of five: nearer the rim the pixels do not hold the texture.
inline FlowScene ball_scene(const std::string& name, int width, int height, const Texture& texture, double turn_deg) {
    FlowScene scene{name, Image(width, height, 1), Image(width, height, 1), FlowField(width, height),
                    std::vector<unsigned char>(size_t(width) * size_t(height))};
    constexpr double steepest = 0.4;  // cosine
    const double radius = 0.42 * height, cx = width / 2.0, cy = height / 2.0, turn = turn_deg * M_PI / 180;
    const auto seen = [&](double px, double py, double angle) {
        const double x = px - cx, y = py - cy, rim = std::hypot(x, y);
        const double cover = std::clamp(radius + 0.5 - rim, 0.0, 1.0);
        if (cover == 0) return 0.0;
        const double z = std::sqrt(std::max(radius * radius - rim * rim, 0.0));
        const double longitude = std::atan2(x, z) - angle, slope = z / radius;
        const double shade = (2 + slope) / 3;
        return cover * shade * (darkest + (brightest - darkest) * texture(radius * longitude, y));
    };
    for (int py = 0; py < height; ++py)
        for (int px = 0; px < width; ++px) {
            const size_t at = size_t(py) * size_t(width) + size_t(px);
            scene.from.data[at] = float(seen(px, py, 0));
            scene.to.data[at] = float(seen(px, py, turn));
            const double x = px - cx, y = py - cy, rim2 = x * x + y * y;
            if (rim2 >= radius * radius) continue;
            const double z = std::sqrt(radius * radius - rim2);
            scene.truth.u[at] = float(std::cos(turn) * x + std::sin(turn) * z - x);
            scene.scored[at] = std::cos(turn) * z - std::sin(turn) * x > steepest * radius && z > steepest * radius;
        }
    return scene;
}

// The camera's noise, sigma = 2.68 + 0.492 sqrt(mu) counts, rounding and saturation.
inline void add_noise(Image& image, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (float& v : image.data) {
        const double sigma = 2.68 + 0.492 * std::sqrt(std::max(double(v), 0.0));
        v = float(std::min(std::round(v + sigma * normal(random)), 4095.0));
    }
}

inline FlowScene noisy(FlowScene scene, unsigned seed = 1) {
    add_noise(scene.from, seed);
    add_noise(scene.to, seed + 1);
    scene.name += ", noise";
    return scene;
}

// Mean endpoint error in pixels over what is scored, and lies within a margin from the border in both images.
inline double endpoint_error(const FlowField& flow, const FlowScene& scene, int margin = 8) {
    double sum = 0;
    size_t count = 0;
    for (int y = margin; y < flow.height - margin; ++y)
        for (int x = margin; x < flow.width - margin; ++x) {
            const size_t at = size_t(y) * size_t(flow.width) + size_t(x);
            const float tx = float(x) + scene.truth.u[at], ty = float(y) + scene.truth.v[at], m = float(margin);
            const bool stays = tx >= m && ty >= m && tx < float(flow.width) - m && ty < float(flow.height) - m;
            if (!scene.scored[at] || !stays) continue;
            sum += std::hypot(double(flow.u[at]) - scene.truth.u[at], double(flow.v[at]) - scene.truth.v[at]);
            count++;
        }
    return sum / double(count);
}

}  // namespace ols::scenes
