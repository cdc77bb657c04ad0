// SPDX-License-Identifier: MIT
// What a take is to become, as people choose it: calibration, targets, estimates, slate; from the command line or the daemon.
#pragma once

#include <string>
#include <vector>

#include "take/take.hpp"

namespace ols {

struct TakeChoices {
    std::string calibration;  // folder; empty: the stage's
    bool nominal = false;     // no calibration: black level and gain as the stage states them
    double fps = 0;           // targets a second of a performance; 0: one target a cycle
    std::string quality;      // motion compensation of a performance; empty: standard
    std::string fill = "none", estimate = "none";
    int witness_step = TakeDescription{}.witness_step;
    TakeInfo slate;
    bool single_float = false;  // 32-bit samples
    bool overwrite = false;
    std::string output;             // archive to make
    std::vector<std::string> also;  // QUALITY=ARCHIVE
};

// An archive that the take is to make.
struct PlannedArchive {
    std::string path;
    TakeTargets targets;
    ArchiveWriter archive;
};

// Errors: there is none, or not of this stage's cameras.
Result<Calibration> open_calibration(const TakeChoices& choices, const StageConfig& stage);

// `fill` and `estimate` are known names.
TakeMasks masks_of(const TakeChoices& choices);

// Errors: choices that contradict each other, a sequence too short.
Result<TakeTargets> targets_of(const TakeChoices& choices, const Sequence& sequence);

// What the choices come to, a sentence each: exact rates, long cycles.
std::vector<std::string> notes_on_targets(const TakeChoices& choices, const Sequence& sequence,
                                          const TakeTargets& targets);

// The archive of `output`, and those of `also`, all made beside.
Result<std::vector<PlannedArchive>> plan_archives(const TakeChoices& choices, const Sequence& sequence,
                                                  const StageConfig& stage, const TakeTargets& targets);

}  // namespace ols
