// SPDX-License-Identifier: MIT
// CameraReader: reads a camera from a thread of its own, and looks at each frame's samples once.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <variant>

#include "device/camera.hpp"
#include "record/board_log.hpp"
#include "record/event_queue.hpp"
#include "record/frame_bits.hpp"
#include "record/frame_look.hpp"
#include "record/frame_room.hpp"
#include "record/record_monitor.hpp"
#include "record/reorder.hpp"

namespace ols {

struct FrameNews {
    std::shared_ptr<Frame> frame;
    FrameWitness witness;
    FrameBits bits;  // of a whole frame
};

// Nothing came for a while.
struct CameraPause {
    uint64_t watermark_ns = 0;  // everything before it has been read
    CameraState state;
    uint64_t disk_drops = 0, host_drops = 0;  // frames dropped by us so far (FrameWitness)
};

// What one camera's recording is told, in one queue. It has no bound of its own: the frames in it are bounded where they are read.
using RecordEvent = std::variant<FrameNews, CameraPause, LogNews, LogEnd>;
using RecordQueue = EventQueue<RecordEvent>;

struct CameraReaderOptions {
    std::optional<double> black_counts;  // measured; without it, the stage's
    std::shared_ptr<FrameRoom> room;     // for frames that are read, and not let go of
    std::function<bool()> waits_for_disk;
};

class CameraReader {
  public:
    static constexpr int pause_ms = 20;

    // Reads into the queue until it is destroyed. The camera was started.
    // `index`: the camera's among the stage's; the monitor knows it.
    CameraReader(Camera& camera, const CameraConfig& config, CameraReaderOptions options, RecordQueue& queue,
                 RecordMonitor& monitor, size_t index);
    ~CameraReader();

    // Frames read so far.
    uint64_t arrivals() const { return arrivals_; }
    // Frames that the camera dropped for want of room so far, as far as the reader knows.
    uint64_t drops() const { return disk_drops_ + host_drops_; }

  private:
    void read();
    bool take_place();
    void count_drops();
    void take_levels(Frame& frame) const;
    void enqueue(Frame frame);

    Camera& camera_;
    const CameraConfig& config_;
    const CameraReaderOptions options_;
    const BitsReader bits_;
    FrameLook look_;
    RecordQueue& queue_;
    RecordMonitor& monitor_;
    const size_t index_, backlog_max_;
    StageBeat& beat_;
    const uint64_t dropped_before_;
    std::atomic<uint64_t> disk_drops_ = 0, host_drops_ = 0;
    std::atomic<uint64_t> arrivals_ = 0;
    size_t frames_behind_disk_ = 0;  // still to be read, that may have come while the disk held the room
    std::atomic<bool> end_ = false;
    std::thread thread_;
};

}  // namespace ols
