// SPDX-License-Identifier: MIT
// Matte frames: which of them are nearest to a target, and their mean at the target's time (Wenger section 7).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "develop/align.hpp"
#include "image/frame.hpp"
#include "image/target_matte.hpp"
#include "stage/calibration.hpp"
#include "stage/sequence.hpp"

namespace ols {

constexpr size_t matte_frames_a_target = 10;

struct MatteFrame {
    uint64_t number = 0;  // lazy_basis.hpp
    std::shared_ptr<const Frame> frame;
};

// The numbers of the recorded matte frames nearest to a target, the earlier of two, within frames_around() of it; in order. As
// many as there are, matte_frames_a_target at most: a lost one's place is taken by the next farther one.
std::vector<uint64_t> nearest_matte_frames(const Sequence& sequence, uint64_t target,
                                           const std::function<bool(uint64_t)>& is_recorded);

// By frame: 1 at the target, falling in a line with the distance in slots to 0 at one matte slot beyond the farthest frame, matte
// slots taken to be evenly spaced over the cycle. The paper has "a weighted average" and no weights.
std::vector<double> matte_weights(std::span<const MatteFrame> frames, uint64_t target, const Sequence& sequence);

// What a matte is made of. At least one frame; `alignment` is of their size and of the target's instant.
struct MatteJob {
    std::span<const MatteFrame> frames;
    std::span<const double> weights;
    std::shared_ptr<const Alignment> alignment;
    const CameraCalibration& calibration;
    const NoiseModel& noise;
    int threads = 0;  // 0: as many as there are processors. Any number gives the same bits.
};

// The weighted mean of the frames brought to the target's time, counts above black over flat field and exposure. A saturated sample
// weighs nothing, nor one of which the alignment's confidence is below trusted_confidence, unless no other is left: then
// those that are not trusted count, and where all are saturated, what they read. A sample that is finite in no frame is 0.
// The variance is the camera's noise at the mean count, of independent samples: sigma^2 times the sum of w^2 over (sum of w)^2;
// unknown for frames of floats.
TargetMatte mean_matte(const MatteJob& job);

}  // namespace ols
