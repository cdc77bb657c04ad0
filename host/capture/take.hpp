// SPDX-License-Identifier: MIT
// Take: records a sequence and writes its archive, one target a cycle, while it plays.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "archive/archive.hpp"
#include "capture/recorder.hpp"
#include "stage/calibration.hpp"

namespace ols {

struct TakeReport {
    RecordReport record;
    int targets_written = 0, targets_missing = 0;
    double saturated_share = 0;  // of a target's pixels that rest on a saturated sample, in the worst target
    // Where the time went: of the whole take, and busy in each thread.
    double seconds_total = 0, seconds_develop = 0, seconds_write = 0;
    std::string write_error;  // the first target that could not be written, and why; empty when all were
};

// Threads: the camera's, the board's, the caller's, which identifies, one that develops, one that writes. Each hands on
// one thing at a time; memory is bounded by frames_in_flight() frames and two targets.
// `identified` sees every frame that has its slot, in the caller's thread. `info` gives slate, lights and units; what the take adds (identification, calibration, program) goes to the manifest.
// Errors: the board cannot be started. Anything later is in the report and in the archive.
Result<TakeReport> run_take(Board& board, Camera& camera, const Sequence& sequence, const StageConfig& stage,
                            const Calibration& calibration, ArchiveWriter& archive, const std::atomic<bool>& stop,
                            const std::function<void(const Frame&)>& identified,
                            const std::function<void(uint64_t decided, uint64_t total)>& progress);

// The mean black level of a calibration, for the optical code; nothing for a nominal one.
std::optional<double> measured_black(const Calibration& calibration);

}  // namespace ols
