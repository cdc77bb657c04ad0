// SPDX-License-Identifier: MIT
// What the verbs that make a take's archives share: which targets, how they are developed, where they go.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "image/line_file.hpp"
#include "stagectl/sequence_options.hpp"
#include "take/take.hpp"

namespace ols {

struct TakeOptions {
    SequenceOptions sequence;
    std::string output, calibration, frames;
    TakeInfo slate;
    std::string fill = "none", estimate = "none", quality;
    std::vector<std::string> also;  // QUALITY=ARCHIVE
    double fps = 0;
    int witness_step = TakeDescription{}.witness_step;
    bool nominal = false, overwrite = false, single_float = false, json = false;

    void add_to(CLI::App& verb);
};

// An archive that the take is to make.
struct PlannedArchive {
    std::string path;
    TakeTargets targets;
    ArchiveWriter archive;
};

Result<Calibration> open_calibration(const TakeOptions& options, const StageConfig& stage);

TakeMasks masks_of(const TakeOptions& options);

// Errors: options that contradict each other, a sequence too short.
Result<TakeTargets> targets_of(const TakeOptions& options, const Sequence& sequence);

// Says on stderr what the options come to: exact rates, long cycles.
void say_targets(const TakeOptions& options, const Sequence& sequence, const TakeTargets& targets);

// The archive of -o, and those of --also, all made beside.
Result<std::vector<PlannedArchive>> plan_archives(const TakeOptions& options, const Sequence& sequence,
                                                  const StageConfig& stage, const TakeTargets& targets);

// The sinks of these archives; frames that have their slot are told to `account`, which is opened with the first of them.
TakeSinks sinks_of(std::vector<PlannedArchive>& planned, const TakeOptions& options, std::optional<LineFile>& account,
                   const char* progress_label);

// Prints what became of the take, with `origin` as JSON, and finishes the account. The verb's exit code.
Result<int> finish_take(const TakeReport& report, bool is_estimate, const std::vector<PlannedArchive>& planned,
                        const TakeOptions& options, std::optional<LineFile>& account,
                        const nlohmann::json& origin = nlohmann::json::object());

}  // namespace ols
