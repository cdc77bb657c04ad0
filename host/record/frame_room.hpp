// SPDX-License-Identifier: MIT
// Frame room: the memory of one camera's frames, all of it made once, and the disk that takes what it does not hold.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "image/frame.hpp"
#include "record/spill_file.hpp"
#include "result.hpp"

namespace ols {

struct RoomUse {
    uint64_t frames_max = 0;  // in memory, besides those that are brought back from the disk
    uint64_t frames_in_memory = 0, bytes_in_memory = 0;
    uint64_t frames_on_disk = 0, bytes_on_disk = 0;  // spilled, and not developed yet
    uint64_t frames_spilled = 0;                     // so far
    bool is_locked = false;                          // its memory cannot be swapped out
    bool disk_has_failed = false;                    // SpillFile::problem() says how
    uint64_t frames_elsewhere = 0;                   // so far: those that no buffer was for, in memory of their own
};

// A frame has a place from before it is read to when its last owner lets go of it, or until it is spilled. Samples that are larger
// than `frame_bytes` (floats, padded rows) take memory of their own, and count as a frame all the same.
// Thread-safe. Lives as long as any of its frames: those made by adopt() may outlive all else.
class FrameRoom : public SampleLender, public std::enable_shared_from_this<FrameRoom> {
  public:
    struct Options {
        size_t frames_max = 0;
        size_t frame_bytes = 0;             // of the camera's samples
        size_t reserve = 0;                 // of frames_max: buffers for those brought back from the disk
        std::shared_ptr<SpillFile> spill;   // null: nothing is spilled
        std::chrono::nanoseconds period{};  // from one frame to the next: a disk that takes longer for one is late
    };

    // What a frame takes of the memory.
    static size_t bytes_a_frame(size_t frame_bytes);

    // All memory is there from then on: a page that the kernel clears when a frame comes holds that one up. Errors: it is not to be had.
    static Result<std::shared_ptr<FrameRoom>> create(Options options);
    ~FrameRoom() override;

    // A place for a frame that is about to be read; false when there was none within `timeout`.
    bool take_place(std::chrono::milliseconds timeout);
    // Of a frame that did not come.
    void give_back_place();
    SampleBuffer lend() override;

    // A frame that was read to its place, and whose samples are not needed until it is developed. Where no place is left for the next
    // one, they go to the disk, if that takes them.
    std::shared_ptr<Frame> adopt(Frame frame);

    // The frame itself, or where it was spilled, a copy of it with its samples. The errors of SpillFile::read().
    Result<std::shared_ptr<const Frame>> bring_back(const std::shared_ptr<const Frame>& frame);

    // Whether a frame that is dropped now is dropped because of the disk: it was too slow for the frame before this, or has
    // failed.
    bool waits_for_disk() const;

    RoomUse use() const;

  private:
    explicit FrameRoom(Options options)
        : options_(std::move(options)), places_(options_.frames_max - options_.reserve) {}
    Status map_memory();
    void take_back(std::byte* memory) noexcept override;
    void spill(Frame& frame);
    void let_go(Frame& frame, size_t bytes);

    const Options options_;
    std::byte* memory_ = nullptr;
    mutable std::mutex mutex_;  // of all below
    std::condition_variable has_place_;
    size_t places_;  // left for frames that are to be read
    std::vector<std::byte*>
        free_;  // buffers; the last used is taken first, so that no more are touched than are needed
    std::unordered_map<const Frame*, SpillFile::Place> spilled_;
    RoomUse use_;
    bool disk_was_slow_ = false;
};

}  // namespace ols
