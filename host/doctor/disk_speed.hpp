// SPDX-License-Identifier: MIT
// How fast a folder's disk writes and reads, measured with a file that has no name: it is gone when the program ends, however.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "result.hpp"

namespace ols {

struct DiskSpeedOptions {
    double seconds_max = 3;                  // for writing, and again for reading
    uint64_t bytes_max = uint64_t(1) << 30;  // and no more than a tenth of what is free
    // Written between two syncs, as an archive syncs each target; less on a disk that is slow.
    uint64_t synced_bytes = uint64_t(96) << 20;
    bool is_read = true;  // back, too
    // How much of the time is over.
    std::function<void(uint64_t done_ms, uint64_t total_ms)> progress = [](uint64_t, uint64_t) {};
};

struct DiskSpeed {
    double write_bytes_per_s = 0;
    std::optional<double>
        read_bytes_per_s;  // nothing where the file system cannot read past the system's memory (O_DIRECT)
    uint64_t bytes = 0;    // written
    double write_s = 0;
};

// Writes bytes that do not compress, in order, each so many of them synced (fdatasync), and reads them back past the system's memory.
// Errors: no file can be made or written there, or too little room.
Result<DiskSpeed> measure_disk(const std::string& folder, const DiskSpeedOptions& options = {});

}  // namespace ols
