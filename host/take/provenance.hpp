// SPDX-License-Identifier: MIT
// Provenance: what targets and the manifest say of where a take came from.
#pragma once

#include <nlohmann/json.hpp>

#include "develop/motion_developer.hpp"
#include "record/recorder.hpp"
#include "take/take.hpp"

namespace ols {

// Of a target: its frames, their ticks, which slots are missing and what stood in for them.
nlohmann::json provenance_of(const CycleFrames& frames, const Sequence& sequence);
nlohmann::json provenance_of(const TargetFrames& frames, const Sequence& sequence);

// Of the take, for the manifest's `extra`. `missing`: one account (missing_ranges.hpp) a camera.
nlohmann::json describe_take(const TakeDescription& take, const TakeTargets& targets, const Board& board,
                             const RecordReport& record, const nlohmann::json& missing,
                             const SuspicionReport& suspicion);

}  // namespace ols
