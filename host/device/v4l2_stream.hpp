// SPDX-License-Identifier: MIT
// The buffers that a V4L2 device fills: mapped, handed to the driver, taken back in order (mmap.rst).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "device/v4l2_device.hpp"

namespace ols {

class V4l2Stream {
  public:
    V4l2Stream(std::shared_ptr<V4l2Device> device, std::string name)
        : device_(std::move(device)), name_(std::move(name)) {}
    ~V4l2Stream() { release(); }
    V4l2Stream(const V4l2Stream&) = delete;
    V4l2Stream& operator=(const V4l2Stream&) = delete;

    // Maps as many buffers as the driver gives, of so many bytes at least. Errors: busy, no memory, stamps of no known clock.
    Status allocate(size_t picture_bytes);
    void release();

    // Hands all buffers to the driver and begins. Without allocate() before it, an error.
    Status begin();
    void end();

    size_t buffers() const { return buffers_.size(); }
    // V4L2_BUF_FLAG_TSTAMP_SRC_..., as the buffers say before any is filled.
    bool stamps_begin() const { return stamps_begin_; }

    // The next buffer that has been filled; its content stays what it is until give_back(). `error` is the errno of the device's
    // refusal, EAGAIN for none there.
    struct Filled {
        int error = 0;
        v4l2_buffer buffer{};
        std::span<const std::byte> content;
    };
    Filled take();
    int give_back(uint32_t index);  // 0, or the errno

    // Of what a buffer was filled with last.
    std::optional<uint32_t> sequence_in(uint32_t index);

  private:
    Error refused(const char* call, int error) const;

    std::shared_ptr<V4l2Device> device_;
    const std::string name_;
    std::vector<std::span<std::byte>> buffers_;
    bool is_allocated_ = false, stamps_begin_ = false;
};

}  // namespace ols
