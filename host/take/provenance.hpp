// SPDX-License-Identifier: MIT
// Provenance: what targets and the manifest say of where a take came from.
#pragma once

#include <nlohmann/json.hpp>

#include "develop/motion_developer.hpp"
#include "record/recorder.hpp"
#include "take/take.hpp"

namespace ols {

// Of a target: its frames, their ticks, which slots are missing and what stood in for them.
nlohmann::json provenance_of(const CycleFrames& frames, const TakeDescription& take);
nlohmann::json provenance_of(const TargetFrames& frames, const TakeDescription& take);

// What a take was recorded with: the board; or the files that a camera kept (take.hpp).
nlohmann::json origin_of(const Board& board);

// Of the take, for the manifest's `extra`. `origin`: origin_of(). `missing`: one account (missing_ranges.hpp) for each of
// the record's cameras.
nlohmann::json describe_take(const TakeDescription& take, const TakeTargets& targets, const nlohmann::json& origin,
                             const RecordReport& record, const std::vector<nlohmann::json>& missing,
                             const SuspicionReport& suspicion);

}  // namespace ols
