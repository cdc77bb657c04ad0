// SPDX-License-Identifier: MIT
// Camera: a source of frames. To add a kind of camera, implement this and name its scheme in open_camera.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "image/frame.hpp"
#include "result.hpp"

namespace ols {

class Camera {
  public:
    virtual ~Camera() = default;

    // The next frame in order of delivery, or nothing within `timeout_ms` (a pause for the caller to look at its stop
    // flag; nothing else is decided by it).
    virtual std::optional<Frame> read(int timeout_ms) = 0;

    // Camera time before which every frame has been delivered, late ones within the reorder window excepted. Read it
    // before read() comes back empty, not after, or a frame may have slipped in between.
    virtual uint64_t watermark_ns() const = 0;

    virtual uint64_t dropped() const = 0;  // frames that the source had no room for
    virtual bool closed() const = 0;       // no more frames will come
};

// "ring:PATH" is a shared-memory ring (device/ring.hpp).
Result<std::unique_ptr<Camera>> open_camera(const std::string& source);

}  // namespace ols
