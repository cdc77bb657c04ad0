// SPDX-License-Identifier: MIT
// A file mapped into memory that another program may cut short at any moment. Loads and stores beyond its end would raise SIGBUS
// and end the process (mmap(2)); here they find zeros, or are lost, and cut() says so from then on.
//
// Method: the mapping's addresses are known to a handler of SIGBUS, which puts memory of nobody's in the place of the whole
// mapping; the load or store is then repeated. Access costs nothing while the file is whole, and memory keeps its ordering for
// the atomics in it, which pread() would not promise (docs/doors/rings.md). Any other SIGBUS goes to who had it before.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <utility>

namespace ols {

class GuardedMapping {
  public:
    // The first `bytes` bytes of `fd`, shared, to read and write. Empty (no data()) when the kernel refuses, errno says why, or
    // when as many mappings as there is room for, 64, exist already.
    GuardedMapping(int fd, size_t bytes);
    GuardedMapping() = default;
    GuardedMapping(GuardedMapping&& other) noexcept { swap(other); }
    GuardedMapping& operator=(GuardedMapping&& other) noexcept {
        swap(other);
        return *this;
    }
    ~GuardedMapping();

    std::byte* data() const { return data_; }
    size_t size() const { return bytes_; }

    // Whether the file was too short for an access so far: what was read since, and all that will be, is zeros.
    bool cut() const;

  private:
    void swap(GuardedMapping& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(bytes_, other.bytes_);
        std::swap(place_, other.place_);
    }

    std::byte* data_ = nullptr;
    size_t bytes_ = 0;
    int place_ = -1;  // among those that the handler knows
};

}  // namespace ols
