// SPDX-License-Identifier: MIT
// What a stage and a sequence ask of the machine: bytes a second of frames and of archives.
#pragma once

#include <cstdint>
#include <vector>

#include "stage/sequence.hpp"

namespace ols {

struct CameraNeeds {
    double frames_per_s = 0;   // that its trigger line asks for, on average over the cycle
    uint64_t frame_bytes = 0;  // in memory and spilled
    // On its link, at most: whole bytes a sample, as a camera without packed formats sends it.
    uint64_t link_frame_bytes = 0;
    uint64_t target_bytes = 0;  // of an archive, at most

    double raw_bytes_per_s() const { return frames_per_s * double(frame_bytes); }
    double link_bytes_per_s() const { return frames_per_s * double(link_frame_bytes); }
};

struct StageNeeds {
    std::vector<CameraNeeds> cameras;  // the stage's
    double targets_per_s = 0;          // of each camera
    double take_s = 0;                 // how long a take is to be
    uint64_t frames_held = 0;          // of each camera, that a take has in memory whatever happens

    double raw_bytes_per_s() const;      // of all cameras
    double archive_bytes_per_s() const;  // of all cameras, while it is recorded
    double held_bytes() const;           // of all cameras
};

// `target_rate_hz` 0: a target a cycle, as `stagectl run` without --fps makes them. `target_bytes`: of each camera's targets, in their
// order; none of a sequence that is no capture.
StageNeeds needs_of(const StageConfig& stage, const Sequence& sequence, double take_s, double target_rate_hz,
                    const std::vector<uint64_t>& target_bytes);

}  // namespace ols
