// SPDX-License-Identifier: MIT
// Develop: from the identified frames of one cycle to a target, by way of calibrate, align and demultiplex.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "archive/archive.hpp"
#include "stage/calibration.hpp"
#include "stage/sequence.hpp"

namespace ols {

struct CycleFrames {
    uint32_t cycle = 0;
    std::vector<std::shared_ptr<const Frame>> slots;  // by slot; null where the slot is missing
};

// Slots of the basis that have no frame.
std::vector<int> missing_basis_slots(const CycleFrames& frames, const Sequence& sequence);

// Inverts the cycle into r (docs/architecture.md, "Units"). The whole part of the black level is subtracted before the
// inversion, so that counts stay integers and their sums exact, and the rest after it, which is the same since the
// inversion is linear. The variance plane is the camera's noise carried through the inversion; frames of floats, which
// come from a camera without noise, have none. Saturated samples mark their pixel.
// A slot that is missing: with the single basis its lamp is missing; with a multiplexed one every lamp rests on it, and
// the target cannot be made: an error that names the slots.
Result<Target> develop_cycle(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                             const NoiseModel& noise);

}  // namespace ols
