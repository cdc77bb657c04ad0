// SPDX-License-Identifier: MIT
// The headers of a target's file, read and checked against the take and the journal.
#pragma once

#include <ImfMultiPartInputFile.h>

#include <string>

#include "archive/archive.hpp"

namespace ols {

// The part of this name, or -1.
int find_part(const Imf::MultiPartInputFile& file, const std::string& name);

// What a file is held against.
struct TargetExpectation {
    const TakeInfo& info;
    int archive_version;
    const TargetEntry& entry;
    uint64_t file_bytes;
};

// Everything of a target but its samples. Errors say what is wrong with the file: parts that are missing, not known, or there
// twice; a part that is not in tiles of 64 x 64 or of another size than the rest; channels of a lamp or part that are missing, not
// known, subsampled or of another type; a picture that no file of this size can hold; attributes that are missing or out of range,
// or those of another target or take.
Result<Target> read_head(const Imf::MultiPartInputFile& file, const TargetExpectation& expected);

}  // namespace ols
