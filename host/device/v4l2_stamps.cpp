// SPDX-License-Identifier: MIT
// Unwrapping by the signed difference, so that a count that begins anew is not taken for one that went around.
#include "device/v4l2_stamps.hpp"

#include <fmt/format.h>

namespace ols {

namespace {

constexpr uint64_t ahead_max_ns = 1'000'000'000;  // a stamp is of the past; the wall clock's is decades ahead

// Drivers keep one or two buffers at work and drop a frame for which there is no other.
constexpr uint64_t buffers_at_work = 2;

// Drivers of before Linux 3.9, and v4l2loopback, leave the clock unsaid; then the time itself has to tell.
Result<uint64_t> time_of(const v4l2_buffer& buffer, uint64_t now_ns) {
    const uint32_t clock = buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK;
    if (clock == V4L2_BUF_FLAG_TIMESTAMP_COPY)
        return fail(
            "its stamps are copies of another program's (V4L2_BUF_FLAG_TIMESTAMP_COPY) and tell no time of a "
            "camera's: use the device that the camera is on");
    const uint64_t time_ns =
        uint64_t(buffer.timestamp.tv_sec) * 1'000'000'000 + uint64_t(buffer.timestamp.tv_usec) * 1000;
    const bool is_known = clock == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC || clock == V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
    if (is_known && time_ns > 0 && time_ns < now_ns + ahead_max_ns) return time_ns;
    return fail(
        fmt::format("its stamps are not of CLOCK_MONOTONIC (flags {:#x}, {} s against {} s now); of a UVC camera: "
                    "echo CLOCK_MONOTONIC | sudo tee /sys/module/uvcvideo/parameters/clock",
                    buffer.flags, int64_t(buffer.timestamp.tv_sec), now_ns / 1'000'000'000));
}

}  // namespace

void V4l2Stamps::start(size_t buffers, bool skipping) {
    given_back_ns_.assign(buffers, 0);
    skipping_ = skipping;
    taken_ = 0;
}

Result<V4l2Stamp> V4l2Stamps::read(const v4l2_buffer& buffer, uint64_t now_ns) {
    const auto time_ns = time_of(buffer, now_ns);
    if (!time_ns.ok()) return time_ns.error();
    V4l2Stamp stamp;
    stamp.time_ns = *time_ns;
    stamp.is_begin = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    const auto step = int32_t(buffer.sequence - last_sequence_);
    const bool goes_on = taken_ > 0 && (step > 0 || last_.id >= uint64_t(-int64_t(step)));
    stamp.id = goes_on ? last_.id + uint64_t(int64_t(step)) : buffer.sequence;
    if (goes_on && step > 1) {
        const uint64_t lost_ns = last_.time_ns + (stamp.time_ns - last_.time_ns) / uint64_t(step);
        if (skipping_ || is_starved(stamp.is_begin ? lost_ns : last_.time_ns)) late_ += uint64_t(step) - 1;
    }
    last_ = stamp;
    last_sequence_ = buffer.sequence;
    ++taken_;
    return stamp;
}

void V4l2Stamps::note_given_back(uint64_t now_ns) {
    if (!given_back_ns_.empty() && taken_ > 0) given_back_ns_[(taken_ - 1) % given_back_ns_.size()] = now_ns;
}

// Of all buffers `taken_` had been filled by then; those that had come back were free again.
bool V4l2Stamps::is_starved(uint64_t needed_ns) const {
    const uint64_t buffers = given_back_ns_.size();
    if (buffers <= buffers_at_work || taken_ + buffers_at_work < buffers) return false;
    return given_back_ns_[(taken_ + buffers_at_work - buffers) % buffers] > needed_ns;
}

}  // namespace ols
