// SPDX-License-Identifier: MIT
// How much of the disk a take will need, and how much there is: known before the light comes.
#pragma once

#include <cstdint>
#include <string>

#include "result.hpp"
#include "stage/sequence.hpp"
#include "stage/stage.hpp"
#include "take/take_choices.hpp"

namespace ols {

// An upper bound of a target's file (archive/archive.hpp): lamps, which are not compressed, and what comes beside them as if it
// were not.
uint64_t target_bytes_max(const Sequence& sequence, const StageConfig& stage, size_t camera, const TakeTargets& targets,
                          bool single_float);

struct DiskForecast {
    uint64_t bytes_needed = 0;   // by the take, at most
    uint64_t bytes_free = 0;     // of the disk, for this user
    uint64_t bytes_reserve = 0;  // that stay free
    double seconds = 0;          // of the take
    double seconds_that_fit = 0;

    bool fits() const { return bytes_needed + bytes_reserve <= bytes_free; }
};

// Of a take of `sequence` into `folder`. Error: the folder cannot be asked.
Result<DiskForecast> forecast_disk(const std::string& folder, const Sequence& sequence, const StageConfig& stage,
                                   const TakeTargets& targets, bool single_float, uint64_t bytes_reserve);

}  // namespace ols
