// SPDX-License-Identifier: MIT
// CameraClock: what a camera's clock says, from the host's, and so by when all its frames have come. A camera that can be asked for
// its time (a latch) is, from time to time; of another the frames' stamps tell, and until one comes only that its clock runs.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>

namespace ols {

// From any thread. Host times are of a clock that does not jump.
class CameraClock {
  public:
    // From the exposure to the frame being there: what the camera, the link (which asks again for lost packets) and the host
    // take, at most. A camera for which more was seen is given twice that.
    static constexpr uint64_t delivery_ns = 1'000'000'000;

    // The camera starts. Without a time of its own it counts from an unknown one, which is not below 0.
    void start(std::optional<uint64_t> camera_ns, uint64_t host_ns);

    // The camera's clock was at least here at that host time: asked for; or by a frame that had come.
    void asked(uint64_t camera_ns, uint64_t host_ns);
    void frame_came(uint64_t camera_ns, uint64_t host_ns);

    // Camera time before which every frame has come. It goes on with the host's clock.
    uint64_t watermark_ns(uint64_t host_ns);

  private:
    double camera_ns_at(uint64_t host_ns) const;

    std::mutex mutex_;
    bool can_be_asked_ = false;
    uint64_t camera_ns_ = 0, host_ns_ = 0;  // at one moment
    double rate_ = 1;                       // camera nanoseconds a nanosecond of the host's, at least
    uint64_t delivery_ns_ = delivery_ns, watermark_ns_ = 0;
};

}  // namespace ols
