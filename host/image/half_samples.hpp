// SPDX-License-Identifier: MIT
// Many floats to halves at once.
#pragma once

#include <half.h>

#include <span>

namespace ols {

// `halves[i]` becomes half(floats[i]), bit for bit (IEEE 754 binary16, to nearest, ties to even), eight at a time where the processor has
// F16C. Both have the same length.
void to_halves(std::span<const float> floats, half* halves);

// Whether all lie within -largest to largest. False for any NaN.
bool all_within(std::span<const float> values, float largest);

}  // namespace ols
