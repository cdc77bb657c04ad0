// SPDX-License-Identifier: MIT
#include "archive_option.hpp"

#include <fmt/format.h>

namespace ols {

void ArchiveOption::add_to(CLI::App& verb) {
    verb.add_option("archive", path, "take.rfa")->required();
    verb.add_flag("--unchecked", is_unchecked,
                  "do not hold targets against their checksums: faster, and changed samples go unnoticed");
}

Result<ArchiveReader> ArchiveOption::open(const char* verb) const {
    auto archive = ArchiveReader::open(path);
    if (!archive) return archive;
    for (const auto& problem : archive->journal_problems()) fmt::print(stderr, "{}: '{}': {}\n", verb, path, problem);
    return archive;
}

Result<TargetReader> ArchiveOption::open_target(const ArchiveReader& archive, const TargetEntry& entry) const {
    return archive.open_target(entry.camera, entry.index, is_unchecked ? TargetCheck::size : TargetCheck::checksum);
}

}  // namespace ols
