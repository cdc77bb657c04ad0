// SPDX-License-Identifier: MIT
// FrameIdCount: ids of a camera that counts in 16 bits, as GigE Vision's block ids do (standard 2.0, section 24.3: 1 to 65535,
// 0 is skipped; a device in extended mode counts in 64 bits), as a count that does not wrap.
#pragma once

#include <cstdint>
#include <optional>

#include "image/frame.hpp"

namespace ols {

// For one thread. A count that has gone beyond 16 bits is one of 64, and left as it is.
class FrameIdCount {
  public:
    // The unwrapped id of a frame: the next that is so from the one before. By how many wraps they are apart their times
    // decide, where frames came evenly before: so many frames fit between. Where no number of wraps does, triggers paused,
    // and the least is taken. A frame of before the last one's time has a lower id.
    uint64_t unwrap(const CameraStamp& stamp);

  private:
    uint64_t wraps_between(uint64_t steps, uint64_t ns) const;
    void measure(uint64_t steps, uint64_t ns);

    std::optional<CameraStamp> last_;        // as the camera counts
    uint64_t unwrapped_ = 0;                 // of the last one
    bool is_wide_ = false;                   // it counts in 64 bits
    uint64_t count_ = 65535;                 // of ids until they repeat
    uint64_t even_steps_ = 0, even_ns_ = 0;  // of the stretch of frames that came evenly
};

}  // namespace ols
