// SPDX-License-Identifier: MIT
// Record monitor: the live account of a recording, which its threads fill and any other reads.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "record/cause.hpp"
#include "record/frame_room.hpp"
#include "record/stage_beat.hpp"

namespace ols {

// Times are this machine's steady clock's (steady_clock.hpp); 0: not yet.
struct BoardProgress {
    uint64_t triggers_planned = 0, triggers_fired = 0;
    uint64_t now_ticks = 0;          // the board's clock, as it last told it
    uint64_t stop_told_ns = 0;       // when a stop was sent to it
    uint64_t dark_confirmed_ns = 0;  // when its own status first said that it no longer plays
    bool has_ended = false;          // its log is read to the end, or it is heard no more
    Reason end;                      // LogEnd::why
};

struct CameraProgress {
    uint32_t index = 0;  // among the stage's
    uint64_t frames_received = 0;
    uint64_t slots_decided = 0;  // every trigger below has its frame or is missing
    CauseCounts missing;         // slots
    uint64_t disk_drops = 0, host_drops = 0;
    RoomUse room;
    bool has_ended = false;  // every slot is decided
};

struct RecordProgress {
    BoardProgress board;
    std::vector<CameraProgress> cameras;  // in the order of the recorded ones
    std::vector<StageProgress> stages;
};

// Of one recording. Thread-safe; a change is a few additions under a lock, some times a frame.
class RecordMonitor {
  public:
    RecordProgress progress() const;

    StageBeats& stages() { return stages_; }

    // For the recording's threads.
    template <typename Change>
    void change_board(Change&& change) {
        const std::lock_guard lock(mutex_);
        change(progress_.board);
    }
    void add_camera(uint32_t index, std::shared_ptr<const FrameRoom> room);
    template <typename Change>
    void change_camera(size_t index, Change&& change) {
        const std::lock_guard lock(mutex_);
        change(*std::ranges::find(progress_.cameras, index, &CameraProgress::index));
    }

  private:
    mutable std::mutex mutex_;
    RecordProgress progress_;  // without rooms and stages, which keep their own accounts
    std::vector<std::shared_ptr<const FrameRoom>> rooms_;
    StageBeats stages_;
};

}  // namespace ols
