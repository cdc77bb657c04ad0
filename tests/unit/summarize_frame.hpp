// SPDX-License-Identifier: MIT
// The block means of a frame that is there whole.
#pragma once

#include "record/frame_summary.hpp"

namespace ols::test {

inline FrameSummary summarize_frame(const Frame& frame, double black_counts, const NoiseModel& noise) {
    BlockSums sums(frame);
    sums.add(frame, 0, frame.height, frame.samples.data());
    return sums.summary(black_counts, noise);
}

}  // namespace ols::test
