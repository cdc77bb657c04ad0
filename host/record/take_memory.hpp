// SPDX-License-Identifier: MIT
// Take memory: where the frames of a take may be until they are developed.
#pragma once

#include <cstdint>
#include <string>

namespace ols {

struct TakeMemory {
    uint64_t ram_bytes = 0;    // for the frames of all cameras; 0: what developing needs at least (frames_in_flight())
    std::string spill_folder;  // on a disk that takes what memory does not; empty: none does
    uint64_t spill_bytes = 0;  // there, at most; 0: as much as the disk has
};

}  // namespace ols
