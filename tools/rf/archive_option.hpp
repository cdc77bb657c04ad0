// SPDX-License-Identifier: MIT
// The options by which the verbs of rf are told which archive to read, and how far to trust it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "archive/archive.hpp"

namespace ols {

struct ArchiveOption {
    std::string path;
    bool is_unchecked = false;

    void add_to(CLI::App& verb);

    // Opens it. What is wrong with its journal is said on standard error, after the verb's name ("rf relight").
    Result<ArchiveReader> open(const char* verb) const;

    Result<TargetReader> open_target(const ArchiveReader& archive, const TargetEntry& entry) const;
};

}  // namespace ols
