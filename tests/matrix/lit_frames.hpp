// SPDX-License-Identifier: MIT
// What a camera sees of each slot: a subject of which every lamp lights a spot and every fourth lamp none of it, with the noise of the
// paper's camera. Each frame carries the number of its trigger in its lowest bits, where the code under test does not look: whatever
// its stamp and its account say, that is whose light it has.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "stage/sequence.hpp"

namespace ols::test {

class LitFrames {
  public:
    LitFrames(const Sequence& sequence, const CameraConfig& camera, uint64_t seed)
        : width_(camera.width), height_(camera.height), black_(camera.black), noise_(camera.noise), random_(seed) {
        for (const Slot& slot : sequence.slots) light_.push_back(light_of(slot));
    }

    // Of trigger `trigger`, or of one whose lamps are dark.
    std::vector<uint16_t> expose(uint64_t trigger, bool is_lit) {
        const auto& light = light_[trigger % light_.size()];
        std::vector<uint16_t> samples(light.size());
        for (size_t p = 0; p < samples.size(); ++p) {
            const double mu = is_lit ? light[p] : 0;
            const double counts = black_ + mu + (noise_.read_counts + noise_.shot * std::sqrt(mu)) * gauss_(random_);
            samples[p] = uint16_t(std::clamp(std::lround(counts), 0L, 4095L));
            if (p < trigger_bits) samples[p] = uint16_t((samples[p] & ~1) | (trigger >> p & 1));
        }
        return samples;
    }

    // '1' for each slot of the cycle that shows light, '0' for each that does not.
    std::string lit_slots() const {
        std::string lit;
        for (const auto& light : light_)
            lit += std::ranges::any_of(light, [](double mu) { return mu > 0; }) ? '1' : '0';
        return lit;
    }

    static uint64_t trigger_of(const uint16_t* samples) {
        uint64_t trigger = 0;
        for (size_t p = 0; p < trigger_bits; ++p) trigger |= uint64_t(samples[p] & 1) << p;
        return trigger;
    }

  private:
    static constexpr size_t trigger_bits = 32;

    std::vector<double> light_of(const Slot& slot) const {
        std::vector<double> light(size_t(width_) * size_t(height_), 0);
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) {
            const bool is_matte = lamp >= 156;
            if (!slot.lit[lamp] || (!is_matte && lamp % 4 == 3)) continue;
            const double x = is_matte ? 1 + 2.5 * double(lamp - 156) : double(lamp * 7 % size_t(width_));
            const double y = is_matte ? 1 : double(lamp * 5 % size_t(height_));
            for (int p = 0; p < width_ * height_; ++p) {
                const double dx = p % width_ - x, dy = p / width_ - y;
                light[size_t(p)] += 0.4 * std::exp(-(dx * dx + dy * dy) / 20) * slot.exposure_ticks / 125.0;
            }
        }
        return light;
    }

    const int width_, height_;
    const double black_;
    const NoiseModel noise_;
    std::vector<std::vector<double>> light_;  // by slot of the cycle
    std::mt19937 random_;
    std::normal_distribution<double> gauss_;
};

}  // namespace ols::test
