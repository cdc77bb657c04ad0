// SPDX-License-Identifier: MIT
// Takes of layers that move, in closed form: every frame is what the camera sees in the middle of its exposure, and the lamps
// of a target are known exactly. Shared by the hard cases of motion and by the unit tests of its developer.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "develop/frame_store.hpp"

namespace ols::moving {

// Albedo at a position in the layer's own pixels, about its centre.
using Albedo = std::function<double(double x, double y)>;

// Eight plane waves, 7 to 40 pixels long, about `mean`, at most `swing` off.
inline Albedo wavy(unsigned seed, double mean = 0.5, double swing = 0.4) {
    std::mt19937 random(seed);
    const auto unit = [&] { return double(random()) / 4294967296.0; };
    std::array<std::array<double, 3>, 8> waves;
    for (auto& [kx, ky, phase] : waves) {
        const double length = 7 * std::pow(40.0 / 7, unit()), angle = 2 * M_PI * unit();
        kx = 2 * M_PI / length * std::cos(angle), ky = 2 * M_PI / length * std::sin(angle);
        phase = 2 * M_PI * unit();
    }
    return [waves, mean, swing](double x, double y) {
        double sum = 0;
        for (const auto& [kx, ky, phase] : waves) sum += std::sin(kx * x + ky * y + phase);
        return mean + swing * sum / 8;
    };
}

inline Albedo even(double albedo) {
    return [albedo](double, double) { return albedo; };
}

struct Offset {
    double x = 0, y = 0;
};

// A flat sheet: lamp i gives it albedo * max(0, normal . direction_i), and where it shines albedo * shine(i) besides.
struct Layer {
    Albedo albedo;
    double radius = INFINITY;                   // of a disc about its centre, pixels; edges blended over a pixel
    std::function<Offset(double)> offset = {};  // of the centre from the image's, after so many slots; none: it stays
    Vec3 normal = {0, 0, 1};
    std::function<double(int)> shine = {};
    double board = 0;  // r under the matte board's lamps, times albedo
    // Of the albedo, relative, after so many slots from the first tracking frame of the middle cycle; none: 1.
    std::function<double(double)> brightness = {};
};

struct Scene {
    std::vector<Layer> layers;  // back to front
    int width = 160, height = 120;
    bool is_noisy = true;  // the camera's: noise, whole counts
    // What tracking light is multiplied with, after so many slots.
    std::function<double(double)> flicker = [](double) { return 1.0; };
};

constexpr float black_counts = 64, white_counts = 4095, counts_per_us = 2.52f;

// What is seen of each layer at one time: albedo times visible share.
inline std::vector<Image> seen_layers(const Scene& scene, double slots) {
    std::vector<Image> seen;
    for (const Layer& layer : scene.layers) {
        const Offset at = layer.offset ? layer.offset(slots) : Offset{};
        const double brightness = layer.brightness ? layer.brightness(slots) : 1;
        Image& own = seen.emplace_back(scene.width, scene.height, 1);
        for (int y = 0; y < scene.height; ++y)
            for (int x = 0; x < scene.width; ++x) {
                const double dx = x - 0.5 * (scene.width - 1) - at.x, dy = y - 0.5 * (scene.height - 1) - at.y;
                const double cover = std::clamp(layer.radius + 0.5 - std::hypot(dx, dy), 0.0, 1.0);
                if (cover == 0) continue;
                own.at(x, y) = float(cover * layer.albedo(dx, dy) * brightness);
                for (size_t below = 0; below + 1 < seen.size(); ++below) seen[below].at(x, y) *= float(1 - cover);
            }
    }
    return seen;
}

// A take, of three cycles at least. Its frames are made when a target asks for them.
class Take {
  public:
    Take(Scene scene, const std::string& basis, std::set<uint64_t> lost = {}, int cycles = 3)
        : scene_(std::move(scene)), lost_(std::move(lost)), lamps_(named_lamps()), sequence_(compiled(basis, cycles)) {
        calibration_ = {Image(scene_.width, scene_.height, 1), Image(scene_.width, scene_.height, 1)};
        std::ranges::fill(calibration_.black.data, black_counts);
        std::ranges::fill(calibration_.flat.data, counts_per_us);
    }
    Take(const Take&) = delete;

    const Sequence& sequence() const { return sequence_; }
    const CameraCalibration& calibration() const { return calibration_; }
    const Scene& scene() const { return scene_; }
    // The first tracking frame of the middle cycle.
    uint64_t middle_target() const { return sequence_.slots.size() + slot_of(SlotKind::tracking); }

    std::shared_ptr<const Frame> frame(uint64_t number) {
        std::shared_ptr<const Frame>& known = frames_[number];
        if (!known) known = rendered(number);
        return known;
    }

    // With the frames of a cycle on either side of the target.
    TargetFrames around(uint64_t target) {
        FrameStore store(sequence_);
        const FrameRange range = frames_around(sequence_, target);
        for (uint64_t number = range.first; number <= range.last; ++number)
            if (!lost_.contains(number) && sequence_.slots[number % sequence_.slots.size()].kind != SlotKind::dark)
                store.add(frame(number));
        return store.around(0, target);
    }

    // For targets at every fifth tracking frame from the middle one, 24 a second.
    MotionDeveloper developer(const std::string& quality, DevelopOptions options = {}) const {
        constexpr int every = 5;
        return {sequence_, calibration_, noise_, std::move(options), *motion_quality(quality), every};
    }

    Target develop(const std::string& quality, uint64_t target, DevelopOptions options = {}) {
        auto developed = developer(quality, std::move(options)).develop(around(target));
        EXPECT_TRUE(developed.ok()) << developed.error().message;
        return std::move(*developed);
    }

    // The middle of a frame's exposure, in slots from the beginning of the take.
    double time_of(uint64_t number) const {
        const Slot& slot = sequence_.slots[number % sequence_.slots.size()];
        return double(number) + 0.5 * slot.exposure_ticks / slot.period_ticks;
    }

    // What lamp `lamp` gives at the target's time, by pixel.
    std::vector<double> truth(uint64_t target, int lamp) {
        const std::vector<Image>& seen = layers(time_of(target));
        std::vector<double> values(seen[0].data.size());
        for (size_t k = 0; k < seen.size(); ++k)
            for (size_t p = 0; p < values.size(); ++p) values[p] += lobe(k, lamp) * double(seen[k].data[p]);
        return values;
    }

    // What the matte board's lamps give at the target's time, by pixel.
    std::vector<double> matte_truth(uint64_t target) {
        const std::vector<Image>& seen = layers(time_of(target));
        std::vector<double> values(seen[0].data.size());
        for (size_t k = 0; k < seen.size(); ++k)
            for (size_t p = 0; p < values.size(); ++p) values[p] += scene_.layers[k].board * double(seen[k].data[p]);
        return values;
    }

    // The root of a target's mean squared error over every third lamp, r, where `counts` (by pixel; empty: everywhere).
    double error(const Target& target, uint64_t number, const std::vector<bool>& counts = {}) {
        double squares = 0, samples = 0;
        for (int lamp = 0; lamp < sphere_lamp_count; lamp += 3) {
            const std::vector<double> values = truth(number, lamp);
            for (size_t p = 0; p < values.size(); ++p) {
                if (!counts.empty() && !counts[p]) continue;
                const double miss = double(target.lamps[size_t(lamp)][p]) - values[p];
                squares += miss * miss, ++samples;
            }
        }
        return std::sqrt(squares / samples);
    }

  private:
    static Sequence compiled(const std::string& basis, int cycles) {
        SequenceConfig config;
        config.basis = basis;
        config.cycles = cycles;
        return *compile_sequence(config, default_stage());
    }

    uint64_t slot_of(SlotKind kind) const {
        uint64_t slot = 0;
        while (sequence_.slots[slot].kind != kind) ++slot;
        return slot;
    }

    double lobe(size_t layer, int lamp) const {
        const Layer& sheet = scene_.layers[layer];
        return std::max(0.0, dot(sheet.normal, lamps_[size_t(lamp)].direction)) + (sheet.shine ? sheet.shine(lamp) : 0);
    }

    const std::vector<Image>& layers(double time) {
        if (layers_time_ != time) layers_ = seen_layers(scene_, time - double(middle_target())), layers_time_ = time;
        return layers_;
    }

    std::shared_ptr<const Frame> rendered(uint64_t number) {
        const Slot& slot = sequence_.slots[number % sequence_.slots.size()];
        const std::vector<Image>& seen = layers(time_of(number));
        const double light_us = slot.exposure_ticks / double(ticks_per_us) *
                                (slot.kind == SlotKind::tracking ? scene_.flicker(time_of(number)) : 1.0);
        std::vector<double> light(seen.size());
        for (size_t k = 0; k < seen.size(); ++k)
            light[k] = slot.kind == SlotKind::matte ? counts_per_us * light_us * scene_.layers[k].board : 0;
        for (size_t k = 0; k < seen.size(); ++k)
            for (int lamp = 0; lamp < sphere_lamp_count; ++lamp)
                light[k] += slot.lit[size_t(lamp)] ? counts_per_us * light_us * lobe(k, lamp) : 0;
        auto frame = std::make_shared<Frame>();
        frame->width = uint32_t(scene_.width), frame->height = uint32_t(scene_.height);
        frame->pitch_bytes = frame->width * 2;
        frame->white = white_counts, frame->identified = true;
        frame->cycle = uint32_t(number / sequence_.slots.size());
        frame->slot = uint32_t(number % sequence_.slots.size());
        frame->tick = number * slot.period_ticks, frame->exposure_ticks = slot.exposure_ticks;
        std::mt19937 random{
            uint32_t(number)};  // a frame's own: the order in which frames are asked for does not matter
        std::normal_distribution<double> normal;
        std::vector<uint16_t> counts(seen[0].data.size());
        for (size_t p = 0; p < counts.size(); ++p) {
            double mean = 0;
            for (size_t k = 0; k < seen.size(); ++k) mean += light[k] * double(seen[k].data[p]);
            // Wenger section 4: sigma = 2.68 + 0.492 sqrt(mu).
            const double sigma = scene_.is_noisy ? noise_.read_counts + noise_.shot * std::sqrt(mean) : 0;
            const double read = black_counts + mean + sigma * normal(random);
            counts[p] = uint16_t(std::lround(std::clamp(read, 0.0, double(white_counts))));
        }
        frame->samples.resize(counts.size() * 2);
        std::memcpy(frame->samples.data(), counts.data(), frame->samples.size());
        return frame;
    }

    const Scene scene_;
    const std::set<uint64_t> lost_;
    const std::vector<LightPosition> lamps_;
    const Sequence sequence_;
    const NoiseModel noise_;
    CameraCalibration calibration_;
    std::map<uint64_t, std::shared_ptr<const Frame>> frames_;
    std::vector<Image> layers_;
    double layers_time_ = NAN;
};

}  // namespace ols::moving
