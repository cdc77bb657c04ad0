// SPDX-License-Identifier: MIT
// Target: all reflectance functions of one output frame of one camera, with what is known of each pixel beside them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "image/frame.hpp"
#include "image/plane.hpp"
#include "image/target_matte.hpp"
#include "image/target_motion.hpp"

namespace ols {

// The bits of a mask sample.
enum MaskBit : uint32_t {
    mask_saturated = 1,   // a sample under these lamp values was at or above white: left out, or counted as it was read
    mask_missing = 2,     // a slot was missing
    mask_outside = 4,     // outside the user's mask (ingest)
    mask_clamped = 8,     // not finite or beyond the sample type's range; stored as 0 (NaN) or the largest finite value
    mask_estimated = 16,  // what was left did not determine the lamp values: the provenance names what did
    mask_unsolved = 32,   // nothing did; the lamp values are 0
    mask_misaligned = 64,  // motion compensation failed: `confidence` is below one half
};

// One output frame of one camera: all OLAT values. Planes are row-major, top to bottom.
struct Target {
    uint32_t camera = 0, index = 0;
    int width = 0, height = 0;
    Cfa cfa = Cfa::none;  // a mosaic stays a mosaic; Cfa::rgb has three planes a lamp
    // [lamp * planes + plane][y * width + x]; r (white = 1) or stored pixel values
    std::vector<Plane> lamps;
    std::vector<uint32_t> mask;   // [y * width + x], MaskBit
    std::vector<float> variance;  // [y * width + x] of one lamp value, mean over lamps; empty if not known
    // [y * width + x]: noise variance of a lamp value over what it is with no sample masked, mean over lamps; 0 where not
    // solved. Empty if no sample of the target was filled in.
    std::vector<float> noise_gain;
    // [y * width + x]: how well the flow that aligned this pixel's samples leads back to where it came from, 0 to 1, the
    // least of all (flow/flow.hpp, confidence()). Empty if nothing was aligned.
    std::vector<float> confidence;
    TargetMatte matte;  // of a performance whose sequence has matte slots; of a head that was read, all but its samples
    std::vector<int> missing_lamps;  // lamps that were not seen (a lost slot of the single basis); their planes are 0
    nlohmann::json provenance;       // cycle, tick, timecode, slots used: goes to the header and the journal
    TargetMotion motion;             // empty if not known; a target that was read has the times only: read_motion()

    int planes() const { return cfa == Cfa::rgb ? 3 : 1; }
};

}  // namespace ols
