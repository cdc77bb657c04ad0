// SPDX-License-Identifier: MIT
// One take of a scenario: the firmware's code plays, the camera sees and its link carries as the injection says, and the project's
// recorder records. What it gave account of stands beside what was done.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "injection.hpp"

namespace ols::test {

struct Played {
    Sequence sequence;
    Injection injection;
    std::string lit;                                     // of the slots of a cycle: 1 where the camera sees light
    uint64_t fired = 0;                                  // triggers, in fact
    std::vector<std::pair<uint64_t, uint64_t>> stalled;  // [first, last] triggers during which nothing was let go of
    std::vector<uint64_t> without_room;                  // triggers whose frames found none, of links that know
    std::vector<bool> stalls_of_disk;                    // of each of them
    std::vector<nlohmann::json> missing;                 // trigger, cause and why, by the account
    std::vector<std::pair<uint64_t, uint64_t>> kept;  // trigger by the account, and the one whose light is in the frame
    nlohmann::json report;                            // what the recorder says beside
};

// `link` is "ring", "gige" or "v4l2"; `work` a folder for files. The error is the recorder's own.
Result<Played> play_take(const Scenario& scenario, const std::string& link, int take, const std::string& work);

}  // namespace ols::test
