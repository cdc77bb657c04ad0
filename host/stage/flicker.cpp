// SPDX-License-Identifier: MIT
// Flicker by Fourier series over the cycle.
#include "stage/flicker.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace ols {

namespace {

double us_of_ticks(uint64_t ticks) {
    return double(ticks) / double(ticks_per_us);
}

// Amplitude over mean of a component of light that flashes at each slot's start.
double modulation_of(const Sequence& sequence, const std::vector<double>& light, int harmonic) {
    std::complex<double> sum = 0;
    double mean = 0;
    uint64_t start = 0;
    const double cycle = double(sequence.cycle_ticks());
    for (size_t s = 0; s < light.size(); ++s) {
        sum += std::polar(light[s], -2 * std::numbers::pi * harmonic * double(start) / cycle);
        mean += light[s];
        start += sequence.slots[s].period_ticks;
    }
    return mean > 0 ? 2 * std::abs(sum) / mean : 0;
}

LampLight measure_lamp(const Sequence& sequence, size_t lamp) {
    LampLight light;
    int flashes = 0;
    uint64_t start = 0, first_on = 0, last_off = 0, longest = 0;
    double lit_ticks = 0;
    for (const Slot& slot : sequence.slots) {
        if (slot.lit[lamp]) {
            if (flashes++ == 0)
                first_on = start;
            else
                longest = std::max(longest, start - last_off);
            last_off = start + slot.exposure_ticks;
            lit_ticks += slot.light_ticks(lamp);
        }
        start += slot.period_ticks;
    }
    const uint64_t cycle = sequence.cycle_ticks();
    longest = flashes ? std::max(longest, cycle - last_off + first_on) : cycle;  // across the cycle's end
    light.longest_dark_us = us_of_ticks(longest);
    light.strobe_hz = flashes * double(tick_hz) / double(cycle);
    light.duty = lit_ticks / double(cycle);
    return light;
}

}  // namespace

FlickerPeak find_flicker(const Sequence& sequence, const std::vector<double>& light) {
    const double cycle_hz = double(tick_hz) / double(sequence.cycle_ticks());
    FlickerPeak peak;
    const int first = std::max(1, int(std::ceil(photosensitive_min_hz / cycle_hz)));
    for (int harmonic = first; harmonic * cycle_hz <= photosensitive_max_hz; ++harmonic) {
        const double modulation = modulation_of(sequence, light, harmonic);
        if (modulation > peak.modulation) peak = {harmonic * cycle_hz, modulation};
    }
    return peak;
}

Flicker measure_flicker(const Sequence& sequence) {
    Flicker flicker;
    std::vector<double> whole;
    uint64_t lit_ticks = 0;
    for (const Slot& slot : sequence.slots) {
        double light = 0;
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) light += slot.light_ticks(lamp);
        whole.push_back(light);
        if (light > 0) lit_ticks += slot.exposure_ticks;
    }
    flicker.whole = find_flicker(sequence, whole);
    flicker.light_duty = double(lit_ticks) / double(sequence.cycle_ticks());
    const size_t lamps = sequence.slots.front().lit.size();
    for (size_t lamp = 0; lamp < lamps; ++lamp) {
        flicker.lamps.push_back(measure_lamp(sequence, lamp));
        std::vector<double> light;
        for (const Slot& slot : sequence.slots) light.push_back(slot.light_ticks(lamp));
        flicker.lamps.back().cycle_modulation = modulation_of(sequence, light, 1);
        const FlickerPeak peak = find_flicker(sequence, light);
        if (peak.modulation > flicker.worst_lamp.modulation) {
            flicker.worst_lamp = peak;
            flicker.worst_lamp_index = int(lamp);
        }
    }
    return flicker;
}

}  // namespace ols
