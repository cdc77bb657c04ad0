// SPDX-License-Identifier: MIT
// BufferStarvation: which gap between frames is that of the frames that found no buffer, where a library counts these as they come and
// the gap shows only when the frames before it have been read.
//
// Method. A frame finds no buffer while all of them are filled and wait to be read, so behind the last one read there are as many frames
// as there are buffers before that gap; what is missing before was lost on the link.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace ols {

class BufferStarvation {
  public:
    void start(size_t buffers, uint64_t unplaced) {
        buffers_ = buffers;
        unplaced_ = unplaced;
        taken_ = 0;
        gaps_after_.clear();
    }

    // A filled buffer is taken; of what came so far `unplaced` found none.
    void take(uint64_t unplaced) {
        if (unplaced != unplaced_) gaps_after_.push_back(taken_ + buffers_);
        unplaced_ = unplaced;
        ++taken_;
    }

    // Whether frames that are missing before the buffer taken last had found none.
    bool explains_gap() {
        const uint64_t before = taken_ - 1;
        while (!gaps_after_.empty() && gaps_after_.front() < before) gaps_after_.pop_front();
        return !gaps_after_.empty() && gaps_after_.front() <= before + being_read;
    }

  private:
    static constexpr uint64_t being_read = 1;  // or none

    uint64_t buffers_ = 0, unplaced_ = 0, taken_ = 0;
    std::deque<uint64_t> gaps_after_;  // so many buffers
};

}  // namespace ols
