// SPDX-License-Identifier: MIT
// How a sequence flickers: each lamp's strobe rate and duty, and the modulation that can harm photosensitive people.
#pragma once

#include "stage/sequence.hpp"

namespace ols {

// Photosensitive epilepsy is provoked between 3 and 60 Hz; IEEE 1789-2015, recommended practice 3, keeps the
// modulation there below 5 % of the mean light.
constexpr double photosensitive_min_hz = 3, photosensitive_max_hz = 60;
constexpr double photosensitive_modulation = 0.05;

struct FlickerPeak {
    double hz = 0;          // 0: the cycle has no component in the band
    double modulation = 0;  // amplitude of the component over the mean light, 0..2
};

struct LampLight {
    double strobe_hz = 0;  // flashes a second, mean
    double longest_dark_us = 0;
    double duty = 0;  // share of time that the lamp is lit
    double cycle_modulation =
        0;  // at the cycle's own rate, amplitude over mean: 2 for one flash a cycle, 0 for evenly spread ones
};

struct Flicker {
    std::vector<LampLight> lamps;
    FlickerPeak whole;       // of all lamps together
    FlickerPeak worst_lamp;  // of the one lamp that flickers most
    int worst_lamp_index = -1;
    double light_duty = 0;  // share of time that any lamp is lit
};

// The strongest component within the photosensitive band of light that flashes at each slot's start for
// `light[slot]` (any unit) and repeats with the cycle: a Fourier series, exact for flashes short against 1/60 s.
FlickerPeak find_flicker(const Sequence& sequence, const std::vector<double>& light);

Flicker measure_flicker(const Sequence& sequence);

}  // namespace ols
