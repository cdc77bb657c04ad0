// SPDX-License-Identifier: MIT
// Spill file: samples of frames that memory does not hold, on a disk, until they are asked for again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

// A file without a name, which goes with the process however that ends. Places that were given back are written again, the
// earliest first. What is read has the checksum of what was written, or is an error. Thread-safe; shared by the cameras.
class SpillFile {
  public:
    struct Place {
        uint64_t offset = 0, bytes = 0;
        uint64_t hash = 0;  // XXH3
    };

    // `bytes_max`: 0: as many as the disk takes. Errors: nothing can be written in the folder.
    static Result<std::shared_ptr<SpillFile>> create(const std::string& folder, uint64_t bytes_max);
    ~SpillFile();
    SpillFile(const SpillFile&) = delete;

    // Whether a record of so many bytes may be written: bytes_max leaves room, and no write has failed.
    bool has_room(uint64_t bytes) const;
    // Errors: no room; the disk's own. After one of the disk's nothing more is written, for it would be waited for again and again.
    Result<Place> write(std::span<const std::byte> bytes);
    // `into` has the size of what was written there. Errors: the disk's own; other bytes than were written.
    Status read(const Place& place, std::span<std::byte> into) const;
    void give_back(const Place& place);

    // What the disk said first, and what to do; empty while all is well.
    std::string problem() const;

  private:
    SpillFile(int fd, std::string folder, uint64_t bytes_max)
        : fd_(fd), folder_(std::move(folder)), bytes_max_(bytes_max) {}
    std::optional<uint64_t> take_room(uint64_t bytes);
    Error disk_failed(const std::string& action, int error) const;

    const int fd_;
    const std::string folder_;
    const uint64_t bytes_max_;
    mutable std::mutex mutex_;  // of what follows; not held while the disk works
    uint64_t end_ = 0;
    std::map<uint64_t, std::vector<uint64_t>> free_;  // offsets, by size
    mutable std::string problem_;
};

}  // namespace ols
