// SPDX-License-Identifier: MIT
// The options by which the verbs of rf are told which targets to work on, and how outputs of several targets are named.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "archive/archive.hpp"

namespace ols {

struct TargetOptions {
    std::string target = "first";  // a number, `first` or `all`
    uint32_t camera = 0;

    void add_to(CLI::App& verb);
    bool takes_all() const { return target == "all"; }
};

struct TargetChoice {
    std::vector<TargetEntry> finished;  // at least one
    std::vector<TargetEntry> missing;   // with `all`: runs that the recording noted as missing, or did not come to

    // What to tell of the missing ones, empty for none; and [{"index", "through" of a run of several}].
    std::string warning() const;
    nlohmann::json missing_json() const;
};

// Errors name the archive and `rf info`, which lists what there is.
Result<TargetChoice> choose_targets(const ArchiveReader& archive, const std::string& path,
                                    const TargetOptions& options);

// "out.exr", or "out_000012.exr" where all targets are written; empty stays empty.
std::string file_of_target(const std::string& path, const TargetEntry& entry, const TargetOptions& options);

// The same for a folder, whose name has no extension: "lamps_000012".
std::string folder_of_target(const std::string& path, const TargetEntry& entry, const TargetOptions& options);

}  // namespace ols
