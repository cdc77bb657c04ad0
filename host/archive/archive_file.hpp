// SPDX-License-Identifier: MIT
// The files of an archive as they are read: regular files in the archive's own folder, and nothing else.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "archive/disk.hpp"
#include "result.hpp"

namespace ols {

// "a pipe", "a link" ...: what an entry of a folder is, by its st_mode.
const char* entry_kind(unsigned mode);

class ArchiveFile {
  public:
    // Opens `name`, relative to the archive's folder `root`. No link is followed on the way from there, and nothing is opened
    // that could block or act: a link, pipe, device, socket or folder in a file's place is an error that says so.
    static Result<ArchiveFile> open(const std::filesystem::path& root, const std::string& name);

    const std::string& path() const { return path_; }  // for messages
    uint64_t size() const { return size_; }            // when it was opened

    // The bytes from `offset` on, as many as there are of `bytes`; fewer only at the end of the file.
    Result<size_t> read(uint64_t offset, void* out, size_t bytes) const;

    // All of it; an error where it is longer than `bytes_max`.
    Result<std::string> text(uint64_t bytes_max) const;

    // Reads all of it, through a buffer: a second reading of the same bytes comes from the system's cache.
    Result<Checksum> checksum() const;

    ArchiveFile(ArchiveFile&& other) noexcept;
    ~ArchiveFile();

  private:
    ArchiveFile(std::string path, int fd, uint64_t size);
    std::string path_;
    int fd_ = -1;
    uint64_t size_ = 0;
};

// "" where a file is as `expected`, else what is wrong with it.
std::string difference(const std::string& name, const Checksum& found, const Checksum& expected);

}  // namespace ols
