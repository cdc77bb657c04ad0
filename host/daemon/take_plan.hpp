// SPDX-License-Identifier: MIT
// What a take is going to be: decided and checked before the light comes, from the configuration and what was asked for.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "daemon/disk_forecast.hpp"
#include "daemon/take_folder.hpp"
#include "stage/sequence.hpp"
#include "take/take_choices.hpp"

namespace ols {

// What was asked for; what is left out is as the configuration says.
struct TakeRequest {
    std::optional<double> seconds;
    std::string slate, notes, quality;
    std::optional<int> number;
    std::optional<double> fps;
    std::vector<std::string>
        also;  // qualities in which a performance is developed besides, each into SLATE_NUMBER-QUALITY.rfa
    bool memory_only = false;  // nothing is spilled: what does not fit into memory is lost, and named

    // What is left out, but for the slate, as in another one.
    TakeRequest completed_by(const TakeRequest& other) const;
    // Whether board, cameras and disk are made ready alike for both.
    bool is_armed_like(const TakeRequest& other) const;
};

// The sequence named `name`: a file of [daemon] sequences, or a basis with the defaults of everything else. Errors: a name that
// could lead out of the folder, none of both, what is wrong with the file.
Result<SequenceConfig> find_sequence(const std::string& name, const DaemonSetup& setup);

// What of [daemon] is not its reader's to know: words of other rooms, and whether this user may write to its folders. With
// `makes_folders` those that are not there are made. The error names file and line.
Status check_daemon(const StageConfig& stage, bool makes_folders);

struct TakePlan {
    Sequence sequence;
    Calibration calibration;
    TakeChoices choices;  // without the archive's name
    TakeTargets targets;
    DiskForecast forecast;
    TakeRequest request;
    std::string sequence_name;

    nlohmann::json to_json() const;
};

// `sequence_name` in force. Errors: all that can be known beforehand, but for a disk without room: that is the forecast's to say.
Result<TakePlan> plan_take(const TakeRequest& request, const std::string& sequence_name, const StageConfig& stage);

}  // namespace ols
