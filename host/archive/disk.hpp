// SPDX-License-Identifier: MIT
// Files that survive a crash: written under a temporary name, synced, renamed, and their directory synced.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

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

// Sets `bytes` of a disk aside behind the first `size` of an open file, which keeps its size: writes into them do not meet a
// full disk. 0 where that was done or the file system cannot do it, else the error number.
int reserve_room(int fd, int64_t size, int64_t bytes);

// A file that will be written once, at the end, when the disk may be full: its room is set aside before.
class ReservedFile {
  public:
    // Makes the file `path` + unfinished_suffix, empty, with room for `bytes`.
    static Result<ReservedFile> create(const std::string& path, int64_t bytes);

    // Writes all of `text` and gives the file its name `path`, which may have moved with its folder since.
    Status write(const std::string& path, const std::string& text);

    ReservedFile(ReservedFile&& other) noexcept;
    ~ReservedFile();

  private:
    explicit ReservedFile(int fd) : fd_(fd) {}
    int fd_ = -1;
};

struct Checksum {
    uint64_t bytes = 0;
    uint32_t crc32 = 0;  // CRC-32 of ISO 3309, as zlib and PNG compute it

    friend bool operator==(const Checksum&, const Checksum&) = default;
};

// A CRC-32 as it is written: eight digits 0-9 a-f.
std::string hex_of(uint32_t crc32);
std::optional<uint32_t> crc32_from_hex(std::string_view digits);

// The CRC-32 of `count` more bytes behind those whose CRC-32 is `before`; 0 for none.
uint32_t crc32_of(uint32_t before, const void* bytes, size_t count);

Checksum checksum_text(const std::string& text);
Result<Checksum> checksum_file(const std::string& path);

}  // namespace ols
