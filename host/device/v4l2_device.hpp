// SPDX-License-Identifier: MIT
// A V4L2 device as the kernel offers it: the few calls that a camera needs, so that a model of the kernel can stand in its place.
#pragma once

#include <linux/videodev2.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "result.hpp"

namespace ols {

// Calls from several threads, as of a file descriptor that was opened not to block.
class V4l2Device {
  public:
    virtual ~V4l2Device() = default;

    // 0, or the errno.
    virtual int ioctl(unsigned long request, void* argument) = 0;

    // What poll(2) says of POLLIN within the time; 0: nothing.
    virtual short poll(int timeout_ms) = 0;

    // A buffer of the device's, shared, to read; nullptr when the kernel refuses.
    virtual std::byte* map(size_t bytes, uint32_t offset) = 0;
    virtual void unmap(std::byte* memory, size_t bytes) = 0;

    // CLOCK_MONOTONIC, which frames are stamped by.
    virtual uint64_t now_ns() const = 0;
};

// Errors: no such device, no permission, with what to do.
Result<std::shared_ptr<V4l2Device>> open_v4l2_device(const std::string& path);

// "RG12", of four characters; those that cannot be printed as '.'.
std::string fourcc_text(uint32_t fourcc);

}  // namespace ols
