// SPDX-License-Identifier: MIT
// SharedFile: a file that is read at any place, from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "result.hpp"

namespace ols {

class SharedFile {
  public:
    // A regular file, through links. Errors name it.
    static Result<SharedFile> open(const std::string& path);

    SharedFile(SharedFile&& other) noexcept
        : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_) {}
    ~SharedFile();

    const std::string& path() const { return path_; }
    uint64_t size() const { return size_; }  // when it was opened

    // All of `to`, or false: the file has not so many bytes from there on, or the disk fails.
    bool read(uint64_t offset, std::span<std::byte> to) const;

  private:
    SharedFile(std::string path, int descriptor, uint64_t size)
        : path_(std::move(path)), descriptor_(descriptor), size_(size) {}
    std::string path_;
    int descriptor_;
    uint64_t size_;
};

}  // namespace ols
