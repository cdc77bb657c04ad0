// SPDX-License-Identifier: MIT
// What a driver says of each buffer it filled: its count, of 32 bits, and its time; and whose fault a gap in the count was.
#pragma once

#include <linux/videodev2.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "result.hpp"

namespace ols {

struct V4l2Stamp {
    uint64_t id = 0;
    uint64_t time_ns = 0;   // CLOCK_MONOTONIC
    bool is_begin = false;  // of the exposure; otherwise the end of the frame
};

// From one thread.
class V4l2Stamps {
  public:
    // All of so many buffers are the driver's. A `skipping` driver (v4l2loopback) counts in full and leaves frames out for a reader
    // that is behind, and for no other reason.
    void start(size_t buffers, bool skipping);

    // The next buffer's, taken at `now_ns`. Errors: a clock that is not this machine's monotonic one (buffer.rst, "Buffer Flags").
    Result<V4l2Stamp> read(const v4l2_buffer& buffer, uint64_t now_ns);

    // The buffer of the last read() is the driver's again.
    void note_given_back(uint64_t now_ns);

    // Ids that were passed over while the driver had hardly a buffer to fill, since ever: we were late, the link was not.
    uint64_t late() const { return late_; }

  private:
    bool is_starved(uint64_t needed_ns) const;

    std::vector<uint64_t> given_back_ns_;  // of the last buffers, in a ring
    bool skipping_ = false;
    uint64_t taken_ = 0, late_ = 0;
    uint32_t last_sequence_ = 0;
    V4l2Stamp last_;
};

}  // namespace ols
