// SPDX-License-Identifier: MIT
// ArchivePlace: the folder of an archive that is being written, beside the name it will have until it takes that name.
#pragma once

#include <filesystem>
#include <string>

#include "result.hpp"

namespace ols {

// Holds a folder as its writer's: an advisory lock (flock) that ends with the process, however it ends. On file systems
// without such locks it holds nothing.
class FolderLock {
  public:
    FolderLock() = default;
    FolderLock(FolderLock&& other) noexcept;
    FolderLock& operator=(FolderLock&& other) noexcept;
    ~FolderLock();

    // Error: the folder cannot be opened, or another process holds it.
    static Result<FolderLock> take(const std::filesystem::path& folder);

    int fd() const { return fd_; }

  private:
    int fd_ = -1;
};

// Whether some process is writing this archive.
bool is_being_written(const std::filesystem::path& folder);

class ArchivePlace {
  public:
    // Makes `.NAME.recording` beside `root`, and holds it and the archive that it is to replace. What a writer left there
    // that died before its first frame is removed.
    // Errors: `root` exists and is not to be overwritten, or is no archive, or holds what is none of an archive's; either is
    // being written by another process; the folder cannot be made.
    static Result<ArchivePlace> make_beside(const std::filesystem::path& root, bool overwrite);

    // Where the files are.
    const std::filesystem::path& folder() const { return folder_; }

    // Gives the folder its name, in one step where the file system can, and removes the archive it replaces, unless that is
    // not any more what it was. After an error the folder stays where it is, for good. Does nothing once that was done.
    Status take();

    ArchivePlace(ArchivePlace&& other) noexcept;
    ~ArchivePlace();  // removes a folder that was never to take its place

  private:
    ArchivePlace() = default;
    Status hold_what_is_replaced();
    Status make_folder();
    Status remove_replaced(const std::filesystem::path& folder);

    std::filesystem::path root_, folder_;
    FolderLock lock_, replaced_lock_;
    bool replaces_ = false, is_ours_ = false, was_placed_ = false;
};

}  // namespace ols
