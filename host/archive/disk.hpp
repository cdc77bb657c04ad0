// SPDX-License-Identifier: MIT
// Files that survive a crash: written under a temporary name, synced, renamed, and their directory synced.
#pragma once

#include <cstdint>
#include <string>

#include "result.hpp"

namespace ols {

// What ends the name of a file that is not finished.
inline constexpr const char* unfinished_suffix = ".part";

// The error a system call left in errno, with the file's name and what helps against it.
Error disk_error(const std::string& action, const std::string& path, int error_number);

// Writes all of `text`; a reader sees the old file or the new one, never a part.
Status write_file_durably(const std::string& path, const std::string& text);

// Gives a file that is already synced its final name, for good.
Status rename_durably(const std::string& from, const std::string& to);

// Makes a directory's entries (new, renamed, removed) last.
Status sync_directory(const std::string& path);

struct Checksum {
    uint64_t bytes = 0;
    uint32_t crc32 = 0;  // CRC-32 of ISO 3309, as zlib and PNG compute it

    friend bool operator==(const Checksum&, const Checksum&) = default;
};

Checksum checksum_text(const std::string& text);
Result<Checksum> checksum_file(const std::string& path);

}  // namespace ols
