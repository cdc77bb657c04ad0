// SPDX-License-Identifier: MIT
// VIDIOC_REQBUFS to VIDIOC_STREAMOFF (vidioc-reqbufs.rst, vidioc-querybuf.rst, vidioc-qbuf.rst, vidioc-streamon.rst).
#include "device/v4l2_stream.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace ols {

namespace {

// The kernel's most (VIDEO_MAX_FRAME): at 2160 frames/s 15 ms.
constexpr uint32_t buffers_asked = VIDEO_MAX_FRAME, buffers_min = 2;
constexpr uint32_t capture = V4L2_BUF_TYPE_VIDEO_CAPTURE;

v4l2_buffer buffer_of(uint32_t index) {
    v4l2_buffer buffer{};
    buffer.type = capture;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
}

}  // namespace

Error V4l2Stream::refused(const char* call, int error) const {
    if (error == EBUSY)
        return fail(name_ + " is busy: another program streams from it; end that one (fuser -v says which)");
    if (error == ENOMEM)
        return fail(name_ + " has no memory for its buffers: take a smaller picture, or end other cameras' programs");
    if (error == ENODEV) return fail(name_ + " is gone: plug it in again");
    return fail(fmt::format("{} does not stream ({}: {}): unplug it and plug it in again, and see dmesg", name_, call,
                            std::strerror(error)));
}

Status V4l2Stream::allocate(size_t picture_bytes) {
    release();
    v4l2_requestbuffers request{};
    request.count = buffers_asked;
    request.type = capture;
    request.memory = V4L2_MEMORY_MMAP;
    if (const int error = device_->ioctl(VIDIOC_REQBUFS, &request); error != 0) return refused("VIDIOC_REQBUFS", error);
    is_allocated_ = true;
    for (uint32_t n = 0; n < request.count; ++n) {
        v4l2_buffer buffer = buffer_of(n);
        if (const int error = device_->ioctl(VIDIOC_QUERYBUF, &buffer); error != 0)
            return refused("VIDIOC_QUERYBUF", error);
        if (buffer.length < picture_bytes)
            return fail(fmt::format("{} has buffers of {} bytes for pictures of {}: its driver is wrong", name_,
                                    buffer.length, picture_bytes));
        stamps_begin_ = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
        std::byte* const memory = device_->map(buffer.length, buffer.m.offset);
        if (!memory) return refused("mmap", errno);
        buffers_.push_back({memory, buffer.length});
    }
    if (buffers_.size() >= buffers_min) return Done{};
    return fail(
        fmt::format("{} gives {} buffer: its driver holds frames back until there are two", name_, buffers_.size()));
}

void V4l2Stream::release() {
    if (!is_allocated_) return;
    is_allocated_ = false;
    for (const auto& buffer : buffers_) device_->unmap(buffer.data(), buffer.size());
    buffers_.clear();
    v4l2_requestbuffers request{};
    request.type = capture;
    request.memory = V4L2_MEMORY_MMAP;
    (void)device_->ioctl(VIDIOC_REQBUFS, &request);  // of none: the driver frees them
}

Status V4l2Stream::begin() {
    if (buffers_.empty()) return fail(name_ + " is not set up");
    for (uint32_t n = 0; n < buffers_.size(); ++n)
        if (const int error = give_back(n); error != 0) return refused("VIDIOC_QBUF", error);
    int type = capture;
    const int error = device_->ioctl(VIDIOC_STREAMON, &type);
    if (error == 0) return Done{};
    end();  // takes the buffers back
    return refused("VIDIOC_STREAMON", error);
}

void V4l2Stream::end() {
    int type = capture;
    (void)device_->ioctl(VIDIOC_STREAMOFF, &type);
}

std::optional<uint32_t> V4l2Stream::sequence_in(uint32_t index) {
    v4l2_buffer buffer = buffer_of(index);
    return device_->ioctl(VIDIOC_QUERYBUF, &buffer) == 0 ? std::optional(buffer.sequence) : std::nullopt;
}

V4l2Stream::Filled V4l2Stream::take() {
    Filled filled;
    filled.buffer = buffer_of(0);
    filled.error = device_->ioctl(VIDIOC_DQBUF, &filled.buffer);
    if (filled.error != 0) return filled;
    if (filled.buffer.index >= buffers_.size()) {
        filled.error = EPROTO;
        return filled;
    }
    const auto& memory = buffers_[filled.buffer.index];
    filled.content = memory.first(std::min<size_t>(filled.buffer.bytesused, memory.size()));
    return filled;
}

int V4l2Stream::give_back(uint32_t index) {
    v4l2_buffer buffer = buffer_of(index);
    return device_->ioctl(VIDIOC_QBUF, &buffer);
}

}  // namespace ols
