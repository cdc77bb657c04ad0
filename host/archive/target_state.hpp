// SPDX-License-Identifier: MIT
// What an open target is made of; for ArchiveReader, which opens it, and TargetReader, which reads it.
#pragma once

#include <ImfMultiPartInputFile.h>

#include <memory>

#include "archive/archive.hpp"
#include "archive/archive_file.hpp"
#include "archive/exr_input.hpp"

namespace ols {

struct TargetReader::State {
    ArchiveFile file;
    const TakeInfo* info;
    std::unique_ptr<ExrInput> input;  // of `file`
    std::unique_ptr<Imf::MultiPartInputFile> exr;
    Target head;

    // Reads and checks the headers. Errors name the file.
    static Result<std::unique_ptr<State>> open(ArchiveFile file, const TakeInfo& info, int archive_version,
                                               const TargetEntry& entry);
};

}  // namespace ols
