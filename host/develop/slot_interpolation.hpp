// SPDX-License-Identifier: MIT
// Slot interpolation: a slot's samples from its frames before and after the target, both brought to the target's time.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "develop/align.hpp"

namespace ols {

// A subject that turns is lit anew as it turns: brought to the target, a slot's frame still has the shading of its own time, up to
// half a cycle off. The same slot's frame across the target errs the other way. Their mean, weighted in a line by time, is
// right where light changes evenly over the cycle. Our own addition to Wenger section 6, which takes the nearer one.
//
// Of each pixel, how much of its weight by time the frame across gets, when a slot's frames lie in these two intervals of the
// alignment: the square of the quotient of its confidence and the nearer one's, each a thirtieth at least, and 1 at most: what is
// hidden to the nearer one alone is not taken from the one across, since flow leads there over 60 ms and more, and errs before
// its confidence tells. 0 where nothing moves: there the nearer one is taken as it is. 16 more values may be read.
std::vector<float> trust_across(const Alignment& alignment, size_t nearer_interval, size_t across_interval);

// A row of samples in a band, and the same slot's across.
template <typename Sum>
struct AcrossBlend {
    std::span<Sum> samples;
    const Sum* across;
    const float* trust_across;
    float share;   // of the nearer one by time, from 1/2 to 1
    float* noise;  // gains `part` of the blend's variance less 1, that of each sample taken as 1
    float part;
};

// samples = (1 - w) samples + w across with w / (1 - w) = trust_across (1 - share) / share. Samples that are masked stay so; where
// those across are, they stay as they are. Integers are rounded, half away from zero, and held to what the inversion takes.
// Arrays are padded to multiples of 16. The same bits on every SIMD path.
template <typename Sum>
void blend_across(const AcrossBlend<Sum>& blend);

}  // namespace ols
