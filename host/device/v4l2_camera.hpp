// SPDX-License-Identifier: MIT
// Cameras of the kernel's Video4Linux: UVC cameras, sensors on a board's own camera port, frame grabbers, v4l2loopback.
//
// Sources: Linux, Documentation/userspace-api/media/v4l (named where used): mmap streaming, `sequence` as the frame's id, stamps of
// CLOCK_MONOTONIC. A frame's time is the begin of its exposure: where the driver stamps the end of the frame (TSTAMP_SRC_EOF) the
// exposure is taken off, if it is timed and so known; what reading out takes is left in, the same for all frames.
#pragma once

#include "device/camera.hpp"
#include "device/v4l2_device.hpp"

namespace ols {

// "/dev/video2", "/dev/v4l/by-id/usb-..." or "2".
Result<std::unique_ptr<Camera>> open_v4l2_camera(const std::string& text, uint32_t index);

// On a device that is open; `path` is for messages.
Result<std::unique_ptr<Camera>> make_v4l2_camera(std::shared_ptr<V4l2Device> device, const std::string& path,
                                                 uint32_t index, int patience_ms = Camera::device_patience_ms);

}  // namespace ols
