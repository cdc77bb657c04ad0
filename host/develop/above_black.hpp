// SPDX-License-Identifier: MIT
// Above black: a frame's samples less its black level, without those that saturated.
#pragma once

#include <cstddef>
#include <cstdint>

namespace ols {

// Which samples are masked, and what those that are not are held to.
struct SampleLimits {
    float white;  // infinity: none is masked but for what is not finite
    int most;     // of counts
};

// out[x] = samples[x * step] - black[x], x < width, or masked_sample<Sample> where it is not below white or not finite; and whether
// any is. `step` is 1 or 3. Samples of 16 bits are subtracted modulo 2^16: what is held and black fit them.
// There is uint16_t to int16_t, int32_t and float, and float to float.
template <typename Count, typename Sample>
bool subtract_black(const Count* samples, size_t step, const SampleLimits& limits, const Sample* black, size_t width,
                    Sample* out);

}  // namespace ols
