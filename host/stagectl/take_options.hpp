// SPDX-License-Identifier: MIT
// What the verbs that make a take's archives share: which targets, how they are developed, where they go.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "image/line_file.hpp"
#include "stagectl/sequence_options.hpp"
#include "take/take_choices.hpp"

namespace ols {

struct TakeOptions : TakeChoices {
    SequenceOptions sequence;
    std::string frames;  // file for a line a frame
    bool json = false;

    void add_to(CLI::App& verb);
};

// Says on stderr what the options come to: exact rates, long cycles.
void say_targets(const TakeOptions& options, const Sequence& sequence, const TakeTargets& targets);

// The sinks of these archives; frames that have their slot are told to `account`, which is opened with the first of them.
TakeSinks sinks_of(std::vector<PlannedArchive>& planned, const TakeOptions& options, std::optional<LineFile>& account,
                   const char* progress_label);

// Prints what became of the take, with `origin` as JSON, and finishes the account. The verb's exit code.
Result<int> finish_take(const TakeReport& report, bool is_estimate, const std::vector<PlannedArchive>& planned,
                        const TakeOptions& options, std::optional<LineFile>& account,
                        const nlohmann::json& origin = nlohmann::json::object());

}  // namespace ols
