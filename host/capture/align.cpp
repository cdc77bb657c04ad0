// SPDX-License-Identifier: MIT
// The identity in space and time, and the rounding.
#include "capture/align.hpp"

#include <cassert>
#include <cmath>

namespace ols {

void align_samples(std::span<const float> samples, std::span<int32_t> aligned) {
    assert(samples.size() == aligned.size());
    for (size_t i = 0; i < samples.size(); ++i) aligned[i] = int32_t(samples[i] + std::copysign(0.5f, samples[i]));
}

}  // namespace ols
