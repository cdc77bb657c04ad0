// SPDX-License-Identifier: MIT
// What a folder's disk has left.
#pragma once

#include <cstdint>
#include <string>

#include "result.hpp"

namespace ols {

struct DiskRoom {
    uint64_t free_bytes = 0;  // to this user
    bool is_memory = false;   // tmpfs: no disk at all
    uint64_t device = 0;      // which file system
};

// Error: there is no such folder, or its disk cannot be asked.
Result<DiskRoom> room_of(const std::string& folder);

}  // namespace ols
