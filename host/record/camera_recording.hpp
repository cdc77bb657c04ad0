// SPDX-License-Identifier: MIT
// CameraRecording: one camera's identification and its account, from what its reader and the board's log tell.
#pragma once

#include <atomic>
#include <chrono>
#include <unordered_map>

#include "record/camera_reader.hpp"
#include "record/clock_fit.hpp"
#include "record/identify.hpp"
#include "record/record_monitor.hpp"
#include "record/recorder.hpp"

namespace ols {

IdentifyOptions identify_options(const Sequence& sequence, uint64_t camera_ns_at_start = 0);

// For one thread.
class CameraRecording {
  public:
    // `place`: the camera's among those that are recorded (LogNews::arrivals).
    CameraRecording(const Sequence& sequence, const RecordedCamera& recorded, size_t place, uint64_t camera_ns_at_start,
                    const std::atomic<bool>& stop, RecordMonitor& monitor);

    // Takes news, and hands on what they decide to the sink.
    void handle(RecordEvent event);
    bool finished() const { return finished_; }

    // Without what is the camera's to say: info and counts.
    CameraReport report() const;

  private:
    using Clock = std::chrono::steady_clock;

    void take(FrameNews news);
    void take(LogNews news);
    void take(LogEnd end);
    void take(CameraPause pause);
    void look_at_bits(FrameNews& news);
    void finish_if_all_came();
    void finish_if_beyond(uint64_t timestamp_ns);
    void finish(Reason why);
    bool has_delivered_all(uint64_t watermark_ns) const;
    void hand_on();
    void identified(const std::shared_ptr<Frame>& frame, const ols_trigger_log_entry& entry);

    const Sequence& sequence_;
    const RecordedCamera& recorded_;
    const size_t place_;
    const std::atomic<bool>& stop_;
    RecordMonitor& monitor_;
    Identifier identifier_;
    std::unordered_map<uint64_t, std::shared_ptr<Frame>> frames_;  // by arrival, until their verdict
    BitsSeen bits_seen_;
    CameraReport report_;
    ClockFit clock_;
    uint64_t clock_restarts_ = 0;  // of the camera, when the fit was begun
    uint64_t slots_total_, fired_ = 0, last_watermark_ns_ = 0, log_end_watermark_ns_ = 0;
    uint64_t disk_drops_ = 0, host_drops_ = 0;
    int silent_looks_ = 0;
    uint64_t frames_after_end_ = 0, frames_beyond_ = 0;  // of the log; of these, from behind the last trigger
    CameraState camera_state_;
    bool log_ended_ = false, finished_ = false;
    Clock::time_point last_came_;  // the log's end, or the last frame behind it
};

}  // namespace ols
