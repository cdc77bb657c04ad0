// SPDX-License-Identifier: MIT
// LampResponse: what a lamp makes of the pulses that the board plays, and what of grey levels survives at the LED.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wire.h"

namespace ols {

// A driver and its LED: light follows LIGHT_EN after a delay, then exponentially, as a current does that charges a
// capacitance. Zeros are a lamp that follows at once.
struct LampResponse {
    double on_delay_us = 0, off_delay_us = 0;  // until the light begins to change (a driver's propagation delays)
    double rise_us = 0, fall_us = 0;           // from 10 to 90 % and back, as data sheets have them
};

// How the board plays a grey slot (protocol/PROTOCOL.md, "Grey levels").
struct GreyTiming {
    int planes = 8;             // bits of a level, 2 to OLS_PLANES_MAX
    double unit_ticks = 200;    // light of level 1
    double shift_ticks = 1246;  // hello's: 176 bits at 17.9 MHz
};

// From a slot's first light on to its last light off, in ticks.
double grey_span_ticks(const GreyTiming& timing);

// The integral of light over a slot that begins dark, for each level, in ticks of full light; the tail after the last
// plane counts.
std::vector<double> grey_light_ticks(const LampResponse& lamp, const GreyTiming& timing);

// How far each level is off the straight line from dark to the highest level, in levels. The line's slope is no error: a
// camera's calibration takes it up.
std::vector<double> grey_errors_levels(const LampResponse& lamp, const GreyTiming& timing);

// The shortest unit, in whole ticks, from which on no level is off by more than half a level. Found by halving: the error
// falls as units grow, as every pulse loses the same light.
uint32_t least_unit_ticks(const LampResponse& lamp, GreyTiming timing);

}  // namespace ols
