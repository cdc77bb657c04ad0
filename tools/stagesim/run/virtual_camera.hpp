// SPDX-License-Identifier: MIT
// A camera of the virtual stage: makes a frame of every trigger, stamps it with its own count and clock, and puts it
// into its ring.
#pragma once

#include <atomic>
#include <fstream>
#include <memory>
#include <string>

#include "device/ring.hpp"
#include "image/line_file.hpp"
#include "render/renderer.hpp"
#include "run/board_messages.hpp"
#include "run/faults.hpp"

namespace ols {

// The camera's clock as it reads at a board tick.
uint64_t camera_time_ns(const CameraClock& clock, uint64_t tick);

// An exposure as the camera delivers it. With a mosaic and quantisation: 16-bit counts with the camera's black and
// white. Without quantisation: 32-bit counts above black, so black is 0, and no white (the largest float).
Frame make_frame(const Exposure& exposure, const CameraConfig& camera, const EffectSet& effects);

// What the camera's ring is told of such frames.
RingContent ring_content(const Setup& setup, const std::set<std::string>& disabled);

class VirtualCamera {
  public:
    // `setup` must outlive the camera.
    // `frames_path` is a file of JSON lines, one a frame, that says what the host must find out: which trigger made it
    // and which lamps of the stage were lit.
    VirtualCamera(const Setup& setup, const std::set<std::string>& disabled, uint32_t index, RingWriter ring,
                  const std::string& frames_path, const std::vector<Fault>& faults, bool wait_for_reader,
                  const std::atomic<bool>& cancelled);

    // From now on every frame that goes into the ring is kept in this file, too: its id and time, 64 bits little-endian each, and its
    // rows without gaps.
    Status keep_frames(const std::string& path);

    Renderer& renderer() { return renderer_; }
    // Steps for an exposure of this camera's trigger; scene time is counted from the first trigger. A frame that nobody wants
    // is counted, and not rendered.
    void expose(const ExposureMessage& message);
    void set_now(uint64_t tick);

    // A start that the ring's reader waits for, until it is confirmed with a tick before which every exposure is behind.
    std::optional<uint32_t> start_asked() const { return ring_.start_asked(); }
    void confirm_start(uint32_t start, uint64_t tick);
    void finish();

    uint64_t triggers() const { return triggers_; }
    uint64_t delivered() const { return delivered_; }
    uint64_t dropped() const { return dropped_; }
    uint64_t unwanted() const { return unwanted_; }
    // The first error of writing `frames_path`, or frames that are kept.
    Status truth_written() const;

  private:
    void deliver(Frame frame);
    void keep(const Frame& frame);
    uint64_t time_ns(uint64_t tick) const;
    void write_truth(const CameraStamp& stamp, uint64_t trigger, uint64_t tick, const std::vector<double>& lit_us);

    const Setup& setup_;
    Renderer renderer_;
    uint32_t index_;
    RingWriter ring_;
    LineFile frames_file_;
    std::ofstream kept_frames_;
    FaultyDelivery delivery_;
    bool wait_for_reader_;
    const std::atomic<bool>& cancelled_;
    CameraClock clock_;
    uint64_t clock_epoch_tick_ = 0;  // the board tick at which clock_ began
    uint64_t first_rise_ = 0;
    uint64_t next_frame_id_ = 1, triggers_ = 0, delivered_ = 0, dropped_ = 0, unwanted_ = 0;
};

}  // namespace ols
