// SPDX-License-Identifier: MIT
// Stuck watch: which stage of the pipeline works and does not advance.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "record/stage_beat.hpp"

namespace ols {

// For one thread; a take each.
class StuckWatch {
  public:
    using Clock = std::chrono::steady_clock;

    // The name of a stage that has worked for longer than `stuck_after` without a beat; empty when there is none. One that waits for a
    // neighbour, or has ended, is not stuck.
    std::string look(const std::vector<StageProgress>& stages, Clock::time_point now,
                     std::chrono::seconds stuck_after) {
        for (const StageProgress& stage : stages) {
            auto [seen, is_new] = seen_.try_emplace(stage.name, Seen{stage.beats, now});
            if (seen->second.beats != stage.beats || stage.activity != StageActivity::works)
                seen->second = {stage.beats, now};
            if (now - seen->second.since > stuck_after) return stage.name;
        }
        return "";
    }

  private:
    struct Seen {
        uint64_t beats;
        Clock::time_point since;
    };
    std::map<std::string, Seen> seen_;
};

}  // namespace ols
