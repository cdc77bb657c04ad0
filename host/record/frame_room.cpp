// SPDX-License-Identifier: MIT
// Buffers from one mapping; the newest frames to the disk.
#include "record/frame_room.hpp"

#include <fmt/format.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstring>

namespace ols {

namespace {

#ifndef MADV_POPULATE_WRITE
constexpr int MADV_POPULATE_WRITE = 23;  // Linux 5.14
#endif

// Every page is written to, so that none is missing later; an error number where there are not enough.
int touch(std::byte* memory, size_t bytes) {
    if (madvise(memory, bytes, MADV_POPULATE_WRITE) == 0) return 0;
    if (errno != EINVAL) return errno;
    std::memset(memory, 0, bytes);
    return 0;
}

}  // namespace

// Buffers begin on cache lines, an odd number of these apart (row_band.cpp has why).
size_t FrameRoom::bytes_a_frame(size_t frame_bytes) {
    return ((frame_bytes + 63) / 64 | 1) * 64;
}

Result<std::shared_ptr<FrameRoom>> FrameRoom::create(Options options) {
    const std::shared_ptr<FrameRoom> room(new FrameRoom(std::move(options)));
    if (const Status mapped = room->map_memory(); !mapped.ok()) return mapped.error();
    return room;
}

Status FrameRoom::map_memory() {
    const size_t stride = bytes_a_frame(options_.frame_bytes);
    use_.frames_max = options_.frames_max - options_.reserve;
    const size_t bytes = options_.frames_max * stride;
    void* const memory =
        mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    int error = memory == MAP_FAILED ? errno : 0;
    if (error == 0) {
        memory_ = static_cast<std::byte*>(memory);
        (void)madvise(memory_, bytes, MADV_HUGEPAGE);  // only quicker
        error = touch(memory_, bytes);
    }
    use_.is_locked = error == 0 && mlock2(memory_, bytes, 0) == 0;  // sanitizers make mlock() do nothing
    if (error != 0)
        return fail(
            fmt::format("{} MB of memory for frames are not to be had: {}; close other programs, or give less, if "
                        "any was given (--memory-mb, or [daemon] memory_mb)",
                        bytes / 1'000'000, std::strerror(error)));
    free_.reserve(options_.frames_max);
    for (size_t n = options_.frames_max; n-- > 0;) free_.push_back(memory_ + n * stride);
    return Done{};
}

FrameRoom::~FrameRoom() {
    if (memory_) munmap(memory_, options_.frames_max * bytes_a_frame(options_.frame_bytes));
}

bool FrameRoom::take_place(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    if (!has_place_.wait_for(lock, timeout, [this] { return places_ > 0; })) return false;
    --places_;
    return true;
}

void FrameRoom::give_back_place() {
    const std::lock_guard lock(mutex_);
    ++places_;
    has_place_.notify_one();
}

SampleBuffer FrameRoom::lend() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return {};
    std::byte* const memory = free_.back();
    free_.pop_back();
    return {shared_from_this(), memory, options_.frame_bytes};
}

void FrameRoom::take_back(std::byte* memory) noexcept {
    const std::lock_guard lock(mutex_);
    free_.push_back(memory);
}

std::shared_ptr<Frame> FrameRoom::adopt(Frame frame) {
    const size_t bytes = frame.samples.size();
    bool is_full;
    {
        const std::lock_guard lock(mutex_);
        ++use_.frames_in_memory;
        use_.bytes_in_memory += bytes;
        use_.frames_elsewhere += bytes > 0 && !frame.samples.is_lent();
        is_full = places_ == 0;
    }
    const std::shared_ptr<Frame> adopted(new Frame(std::move(frame)), [room = shared_from_this(), bytes](Frame* last) {
        room->let_go(*last, bytes);
        delete last;
    });
    if (is_full && bytes > 0 && options_.spill && options_.spill->has_room(bytes)) {
        spill(*adopted);
    } else {
        const std::lock_guard lock(mutex_);
        disk_was_slow_ = false;
    }
    return adopted;
}

// What the disk does not take stays where it is.
void FrameRoom::spill(Frame& frame) {
    using Clock = std::chrono::steady_clock;
    const size_t bytes = frame.samples.size();
    const auto begin = Clock::now();
    const auto place = options_.spill->write({frame.samples.data(), bytes});
    const bool was_slow = Clock::now() - begin > options_.period;
    if (place.ok()) frame.samples = {};
    const std::lock_guard lock(mutex_);
    disk_was_slow_ = was_slow;
    if (!place.ok()) return;
    spilled_[&frame] = *place;
    ++use_.frames_spilled;
    ++use_.frames_on_disk, use_.bytes_on_disk += bytes;
    --use_.frames_in_memory, use_.bytes_in_memory -= bytes;
    ++places_;
    has_place_.notify_one();
}

void FrameRoom::let_go(Frame& frame, size_t bytes) {
    frame.samples = {};  // before the place: whoever takes that finds a buffer
    const std::lock_guard lock(mutex_);
    if (const auto found = spilled_.find(&frame); found != spilled_.end()) {
        options_.spill->give_back(found->second);
        spilled_.erase(found);
        --use_.frames_on_disk, use_.bytes_on_disk -= bytes;
        return;
    }
    --use_.frames_in_memory, use_.bytes_in_memory -= bytes;
    ++places_;
    has_place_.notify_one();
}

Result<std::shared_ptr<const Frame>> FrameRoom::bring_back(const std::shared_ptr<const Frame>& frame) {
    SpillFile::Place place;
    {
        const std::lock_guard lock(mutex_);
        const auto found = spilled_.find(frame.get());
        if (found == spilled_.end()) return frame;
        place = found->second;
    }
    auto copy = std::make_shared<Frame>(*frame);
    copy->samples = lend();
    copy->samples.make_room(place.bytes);
    if (const Status read = options_.spill->read(place, {copy->samples.data(), copy->samples.size()}); !read.ok())
        return read.error();
    return std::shared_ptr<const Frame>(std::move(copy));
}

bool FrameRoom::waits_for_disk() const {
    const std::lock_guard lock(mutex_);
    return options_.spill && (disk_was_slow_ || !options_.spill->problem().empty());
}

RoomUse FrameRoom::use() const {
    const std::lock_guard lock(mutex_);
    RoomUse use = use_;
    use.disk_has_failed = options_.spill && !options_.spill->problem().empty();
    return use;
}

}  // namespace ols
