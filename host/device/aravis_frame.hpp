// SPDX-License-Identifier: MIT
// From buffers of Aravis to frames: whose they are, whether they are whole, when they were exposed.
#pragma once

#include "device/aravis_link.hpp"
#include "device/frame_id_count.hpp"
#include "image/frame.hpp"

namespace ols {

// For one thread, from one start of a camera to its stop.
class AravisFrames {
  public:
    AravisFrames(AravisLink& link, AravisSetup setup, uint32_t index);

    enum class Kind {
        whole,
        incomplete,  // not all of it came, or what came is no image
        none,        // no frame: the stream ended while it was filled
    };
    // What the buffer holds; of a whole frame `frame` is made. One of another size or format than was set up comes as it is, without
    // samples where it cannot be read.
    Kind read(ArvBuffer* buffer, Frame& frame);

  private:
    uint64_t time_ns(ArvBuffer* buffer);
    bool unpack(ArvBuffer* buffer, Frame& frame) const;

    const AravisSetup setup_;
    const uint32_t index_;
    const bool counts_16_bits_;
    FrameIdCount ids_;
    ObjectPointer<ArvChunkParser> chunks_;  // null: frames have no time of their own
    uint64_t chunk_ticks_hz_;
};

}  // namespace ols
