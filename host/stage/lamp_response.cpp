// SPDX-License-Identifier: MIT
// Light through each plane's pulse in closed form, plane after plane.
#include "stage/lamp_response.hpp"

#include <algorithm>
#include <cmath>

#include "stage/playback.hpp"

namespace ols {

namespace {

constexpr double shortest_event_ticks = 8, latch_ticks = 12;  // PROTOCOL.md: the wait before a latch, and the latch

struct Pulse {
    double on_ticks, off_ticks;
};

// When plane k of a slot is lit, the most significant first.
std::vector<Pulse> pulses_of(const GreyTiming& timing) {
    std::vector<Pulse> pulses;
    double on = 0;
    for (int plane = timing.planes - 1; plane >= 0; --plane) {
        const double lit = std::ldexp(timing.unit_ticks, plane);
        pulses.push_back({on, on + lit});
        const double busy = lit >= timing.shift_ticks ? lit : std::max(lit + shortest_event_ticks, timing.shift_ticks);
        on += busy + shortest_event_ticks + latch_ticks;
    }
    return pulses;
}

// An exponential approach: light after some time, and its integral over that time. With a time constant of zero the
// light is there at once.
struct Lamp {
    double light = 0, integral_ticks = 0;

    void approach(double target, double time_constant_ticks, double ticks) {
        const double left = time_constant_ticks > 0 ? std::exp(-ticks / time_constant_ticks) : 0;
        integral_ticks += target * ticks + (light - target) * time_constant_ticks * (1 - left);
        light = target + (light - target) * left;
    }
};

// From 10 to 90 % an exponential takes ln 9 time constants.
double time_constant_ticks(double ten_to_ninety_us) {
    return ten_to_ninety_us * double(ticks_per_us) / std::log(9.0);
}

double light_ticks(const LampResponse& lamp, const std::vector<Pulse>& pulses, uint32_t level) {
    const double rise = time_constant_ticks(lamp.rise_us), fall = time_constant_ticks(lamp.fall_us);
    Lamp now;
    double at = 0;  // what has been added up reaches until then
    for (size_t n = 0; n < pulses.size(); ++n) {
        if (!(level >> (pulses.size() - 1 - n) & 1)) continue;
        // Where delays make pulses overlap, the lamp stays on; where they eat a pulse up, it stays off.
        const double on = std::max(at, pulses[n].on_ticks + lamp.on_delay_us * double(ticks_per_us));
        const double off = pulses[n].off_ticks + lamp.off_delay_us * double(ticks_per_us);
        if (off <= on) continue;
        now.approach(0, fall, on - at);
        now.approach(1, rise, off - on);
        at = off;
    }
    return now.integral_ticks + now.light * fall;
}

double largest_error(const LampResponse& lamp, const GreyTiming& timing) {
    double largest = 0;
    for (const double error : grey_errors_levels(lamp, timing)) largest = std::max(largest, std::abs(error));
    return largest;
}

}  // namespace

double grey_span_ticks(const GreyTiming& timing) {
    return pulses_of(timing).back().off_ticks;
}

std::vector<double> grey_light_ticks(const LampResponse& lamp, const GreyTiming& timing) {
    const auto pulses = pulses_of(timing);
    std::vector<double> light;
    for (uint32_t level = 0; level < 1u << timing.planes; ++level) light.push_back(light_ticks(lamp, pulses, level));
    return light;
}

std::vector<double> grey_errors_levels(const LampResponse& lamp, const GreyTiming& timing) {
    auto light = grey_light_ticks(lamp, timing);
    const double unit = light.back() / double(light.size() - 1);
    for (size_t level = 0; level < light.size(); ++level)
        // A lamp that never lights is as far off as can be.
        light[level] = unit > 0 ? light[level] / unit - double(level) : double(level);
    return light;
}

uint32_t least_unit_ticks(const LampResponse& lamp, GreyTiming timing) {
    constexpr double half_a_level = 0.5;
    const auto is_enough = [&](uint32_t unit_ticks) {
        timing.unit_ticks = unit_ticks;
        return largest_error(lamp, timing) <= half_a_level;
    };
    uint32_t enough = uint32_t(shortest_event_ticks);
    while (!is_enough(enough)) enough *= 2;
    uint32_t too_short = enough / 2;
    while (enough - too_short > 1) {
        const uint32_t middle = (enough + too_short) / 2;
        (is_enough(middle) ? enough : too_short) = middle;
    }
    return std::max(enough, uint32_t(shortest_event_ticks));
}

}  // namespace ols
