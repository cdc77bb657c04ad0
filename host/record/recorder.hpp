// SPDX-License-Identifier: MIT
// Recorder: plays a sequence on the board, takes the camera's frames, and hands on each one with its slot.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "device/board.hpp"
#include "device/camera.hpp"
#include "record/identify.hpp"
#include "stage/sequence.hpp"
#include "stage/stage.hpp"

namespace ols {

// Called from the thread that calls record_take. A sink that takes long holds up the camera, in the end: at most
// frames_in_flight() frames are kept.
struct RecordSink {
    // An identified frame; `tick` and the other fields of identification are set. The frame's memory is counted against
    // the bound until the last owner lets go of it.
    std::function<void(std::shared_ptr<const Frame>)> frame;
    std::function<void(const MissingSlot&)> missing;
    std::function<void(uint64_t decided, uint64_t total)> progress;  // every trigger below `decided` has had its call
    size_t cycles_kept = 0;  // whose frames the sink holds besides the one being developed and the one being gathered
};

struct RecordReport {
    uint64_t frames = 0, frames_discarded = 0, duplicates = 0, camera_restarts = 0;
    uint64_t slots_total = 0, slots_missing = 0;
    uint64_t stale_buffers = 0;         // frames with the samples of an earlier one, bit for bit
    uint64_t frames_without_noise = 0;  // frames of which that cannot be told (frame_bits.hpp)
    CameraInfo camera;                  // as it was set up
    CameraCounts camera_counts;         // of this take
    double clock_drift_ppm = 0;
    std::string unfit_frame;  // the first frame that was not of the stage's size or format; empty when there was none
    std::string board_end;    // why the board's log ended before the sequence did; empty when it did not
    std::string camera_end;   // why the camera gave no more before it had delivered everything; empty when it had
};

// Frames that may be in memory at once: three cycles (one being developed, one gathered, one waiting for its proof), those
// that the sink keeps besides, and two reorder windows.
size_t frames_in_flight(const Sequence& sequence, size_t cycles_kept = 0);

// Loads, arms and starts the sequence as its playback says; after that the board plays, or waits for an edge. The error is the
// board's own, or says what a latched fault was.
Status start_board(Board& board, const Sequence& sequence, const StageConfig& stage);

// Sets the camera up as the stage's first [[camera]] says and starts it, loads the sequence, arms and starts the board, and
// returns when every trigger is decided. `stop` ends it early, and so does a camera that fails: the board goes dark, what was
// fired is still identified, the rest is missing.
// Errors: the camera is not as the stage says or cannot be started; the board cannot be loaded or started. A board or camera that fails later is no error here: what was proved
// stands, the rest is missing and says why.
// `black_counts` is the camera's measured black level; without it, the one that each frame states.
Result<RecordReport> record_take(Board& board, Camera& camera, const Sequence& sequence, const StageConfig& stage,
                                 std::optional<double> black_counts, const RecordSink& sink,
                                 const std::atomic<bool>& stop);

}  // namespace ols
