// SPDX-License-Identifier: MIT
// Recorder: plays a sequence on the board, takes the cameras' frames, and hands on each one with its slot.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "device/board.hpp"
#include "device/camera.hpp"
#include "record/clock_fit.hpp"
#include "record/identify.hpp"
#include "record/record_monitor.hpp"
#include "record/stop_request.hpp"
#include "stage/sequence.hpp"
#include "stage/stage.hpp"

namespace ols {

// One camera's share of a take. Called from that camera's thread. A sink that keeps frames for long holds up its camera, in the end:
// when they have no more room.
struct RecordSink {
    // An identified frame; `tick` and the other fields of identification are set. The frame's memory is counted against
    // the bound until the last owner lets go of it.
    std::function<void(std::shared_ptr<const Frame>)> frame;
    std::function<void(const MissingSlot&)> missing;
    std::function<void(uint64_t decided, uint64_t total)> progress;  // every trigger below `decided` has had its call
    // For the frames, until the last owner lets go of them; null: as many as frames_in_flight(). Samples may be on a disk when a frame
    // is handed on (FrameRoom::bring_back()).
    std::shared_ptr<FrameRoom> room = {};
    // Whether what holds frames waits for a disk, for the cause of those that are dropped meanwhile; from any thread.
    std::function<bool()> waits_for_disk = {};
};

struct RecordedCamera {
    Camera& camera;
    uint32_t index = 0;                  // among the stage's
    std::optional<double> black_counts;  // measured; without it, the stage's
    RecordSink sink;
};

// What became of one camera's frames.
struct CameraReport {
    uint32_t index = 0;   // among the stage's
    CameraInfo camera;    // as it was set up
    CameraCounts counts;  // of this take
    uint64_t frames = 0, frames_discarded = 0, duplicates = 0, restarts = 0;
    uint64_t stale_buffers = 0;          // frames with the samples of an earlier one, bit for bit
    uint64_t frames_without_noise = 0;   // frames of which that cannot be told (frame_bits.hpp)
    CauseCounts missing;                 // slots, by cause
    CauseCounts discarded;               // frames that came and are no slot's
    std::optional<ClockRelation> clock;  // its own, of the identified frames
    std::string unfit_frame;  // the first frame that was not of the stage's size or format; empty when there was none
    Reason end;               // why it gave no more before it had delivered everything; empty when it had
};

struct RecordReport {
    uint64_t slots_total = 0;  // of each camera
    Reason board_end;          // why the board's log ended before the sequence did; empty when it did not
    std::optional<ClockRelation> host_clock;  // this machine's steady clock
    std::vector<CameraReport> cameras;        // in their order

    CauseCounts missing() const {
        CauseCounts sum;
        for (const CameraReport& camera : cameras) sum.add(camera.missing);
        return sum;
    }
};

// A camera's frames that must have room at once: three cycles (one being developed, one gathered, one waiting for its proof),
// `cycles_kept` that developing holds besides, and two reorder windows.
size_t frames_in_flight(const Sequence& sequence, size_t cycles_kept = 0);

// Loads and arms the sequence as its playback says. The error is the board's own, or says what a latched fault was.
Status arm_board(Board& board, const Sequence& sequence, const StageConfig& stage);

// Starts what is armed; after that the board plays, or waits for an edge.
Status start_armed_board(Board& board);

// Both.
Status start_board(Board& board, const Sequence& sequence, const StageConfig& stage);

// Sets the cameras up as the stage says and starts them, loads the sequence, arms and starts the board, and returns when every
// trigger is decided for each camera. Each has its reader, its identification and its sink, in threads of its own: what one loses
// the others do not. `stop` ends the take early, and so do the cameras when none of them is left: the board goes dark, what was
// fired is still identified, the rest is missing. A board `is_armed` by arm_board() with this sequence is only
// started. `monitor`, which may be null, follows; it has seen no other recording.
// Errors: a camera is not as the stage says or cannot be started; the board cannot be loaded or started. A board or camera that
// fails later is no error here: what was proved stands, the rest is missing and says why.
Result<RecordReport> record_take(Board& board, const std::vector<RecordedCamera>& cameras, const Sequence& sequence,
                                 const StageConfig& stage, const StopRequest& stop, RecordMonitor* monitor = nullptr,
                                 bool is_armed = false);

}  // namespace ols
