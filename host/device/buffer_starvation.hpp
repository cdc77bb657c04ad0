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
        taken_ = last_whole_ = 0;
        gaps_after_.clear();
    }

    // A filled buffer is taken; of what came so far `unplaced` found none.
    void take(uint64_t unplaced) {
        if (unplaced != unplaced_) gaps_after_.push_back(taken_ + buffers_);
        unplaced_ = unplaced;
        ++taken_;
    }

    // What was taken last is a whole frame. Whether those that are missing before it, since the last whole one, had found none, be it for
    // some of their packets only.
    bool explains_gap() {
        while (!gaps_after_.empty() && gaps_after_.front() < last_whole_) gaps_after_.pop_front();
        last_whole_ = taken_;
        return !gaps_after_.empty() && gaps_after_.front() < taken_ + being_read;
    }

  private:
    static constexpr uint64_t being_read = 1;  // or none

    uint64_t buffers_ = 0, unplaced_ = 0, taken_ = 0;
    uint64_t last_whole_ = 0;          // of those taken
    std::deque<uint64_t> gaps_after_;  // so many buffers
};

}  // namespace ols
