// SPDX-License-Identifier: MIT
// Frame look: all that is taken from every frame's samples when it is received, in one pass, while they are near.
#pragma once

#include "device/row_copy.hpp"
#include "record/frame_bits.hpp"
#include "record/frame_summary.hpp"

namespace ols {

class FrameLook : public RowWatcher {
  public:
    void watch(const Frame& frame, uint32_t first_row, uint32_t rows, const std::byte* samples) override;

    // Nothing has been seen, whatever was.
    void forget() { rows_seen_ = 0; }
    // Looks at those rows of a frame with all its samples that were not shown; then the sums and the hash are the frame's.
    void complete(const Frame& frame);

    const BlockSums& sums() const { return sums_; }
    uint64_t hash() const { return hash_.value(); }

  private:
    BlockSums sums_;
    RowHash hash_;
    uint32_t rows_seen_ = 0;
};

}  // namespace ols
