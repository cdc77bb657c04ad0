// SPDX-License-Identifier: MIT
// Align: brings the calibrated samples of a slot to the target's time, before they are demultiplexed.
#pragma once

#include <cstdint>
#include <span>

namespace ols {

// Rounds aligned samples (counts above black) to the signed integer counts that the exact inversion sums, half away from
// zero. For a subject that does not move, aligned samples are the camera's own, whole counts less a whole black level,
// and pass unchanged. |samples| < 2^31.
void align_samples(std::span<const float> samples, std::span<int32_t> aligned);

}  // namespace ols
