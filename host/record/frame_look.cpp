// SPDX-License-Identifier: MIT
// Rows to the sums and to the hash.
#include "record/frame_look.hpp"

#include <cassert>

namespace ols {

void FrameLook::watch(const Frame& frame, uint32_t first_row, uint32_t rows, const std::byte* samples) {
    assert(first_row == 0 || first_row == rows_seen_);
    if (first_row == 0) sums_ = BlockSums(frame), hash_.begin();
    sums_.add(frame, first_row, rows, samples);
    hash_.add(frame, rows, samples);
    rows_seen_ = first_row + rows;
}

void FrameLook::complete(const Frame& frame) {
    if (rows_seen_ < frame.height)
        watch(frame, rows_seen_, frame.height - rows_seen_,
              frame.samples.data() + rows_seen_ * size_t(frame.pitch_bytes));
}

}  // namespace ols
