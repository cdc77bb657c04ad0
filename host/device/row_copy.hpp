// SPDX-License-Identifier: MIT
// Row copy: a frame's samples from a device's memory into its own, and a look at them on the way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "image/frame.hpp"

namespace ols {

// Looks at samples while they are near. Of a frame rows come in their order, from the first one on.
class RowWatcher {
  public:
    virtual ~RowWatcher() = default;
    // Rows of a frame of which all but the samples is known; `samples`: of these rows, frame.pitch_bytes apart.
    virtual void watch(const Frame& frame, uint32_t first_row, uint32_t rows, const std::byte* samples) = 0;
};

// For one thread.
class RowCopy {
  public:
    // Copies the samples of a frame of which all else is set. Each byte is read once: what `watcher` is shown, if there is one, is
    // what the frame gets, also where somebody else writes to `samples` meanwhile.
    void copy(const std::byte* samples, Frame& frame, RowWatcher* watcher);

  private:
    std::vector<std::byte> near_;  // some rows, in the nearest cache
};

}  // namespace ols
