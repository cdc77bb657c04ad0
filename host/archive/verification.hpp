// SPDX-License-Identifier: MIT
// The checks of `rf verify`: every file against the journal, and the journal against itself and the manifest.
#pragma once

#include <filesystem>
#include <functional>

#include "archive/archive.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"

namespace ols {

struct ArchiveToVerify {
    const std::filesystem::path& root;
    const Manifest& manifest;
    const Journal& journal;
    bool is_being_written;
    std::function<Result<TargetReader>(const TargetEntry&)> open_target;  // checks the header, not the checksum
};

Verification verify_archive(const ArchiveToVerify& archive, bool deep);

}  // namespace ols
