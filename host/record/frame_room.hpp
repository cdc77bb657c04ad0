// SPDX-License-Identifier: MIT
// Frame room: how many of a camera's frames may be in memory at once, and how many are.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <semaphore>

namespace ols {

struct RoomUse {
    uint64_t frames_max = 0;  // in memory
    uint64_t frames_in_memory = 0, bytes_in_memory = 0;
    uint64_t frames_on_disk = 0, bytes_on_disk = 0;  // spilled, and not developed yet
};

// Thread-safe. Shared by the reader and every frame, which may outlive it.
class FrameRoom {
  public:
    explicit FrameRoom(size_t frames_max) : frames_max_(frames_max), places_(ptrdiff_t(frames_max)) {}

    // A place for a frame that is about to be read; false when none was given back within `timeout`.
    bool take_place(std::chrono::milliseconds timeout) { return places_.try_acquire_for(timeout); }
    // Of a frame that did not come.
    void give_back_place() { places_.release(); }

    // A frame has come to the place, and leaves it.
    void hold(size_t bytes) { ++frames_, bytes_ += bytes; }
    void let_go(size_t bytes) {
        --frames_, bytes_ -= bytes;
        places_.release();
    }

    RoomUse use() const { return {frames_max_, frames_, bytes_}; }

  private:
    const size_t frames_max_;
    std::counting_semaphore<> places_;
    std::atomic<uint64_t> frames_ = 0, bytes_ = 0;
};

}  // namespace ols
