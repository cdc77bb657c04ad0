// SPDX-License-Identifier: MIT
// Frames in, and what is known of each.
#include "record/camera_reader.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "exceptions.hpp"

namespace ols {

namespace {

// Beside those that wait in a camera's own buffers: some that were being filled or read, and the one behind the gap.
constexpr size_t beside_buffers = 76;

// Whether the samples are there, so that they can be looked at at all, and of the stage's size and colour filter.
bool is_whole(const Frame& frame, const CameraConfig& config) {
    const size_t bytes = sample_bytes(frame.format);
    return frame.width == uint32_t(config.width) && frame.height == uint32_t(config.height) &&
           frame.cfa == config.cfa && frame.pitch_bytes >= row_samples(frame) * bytes &&
           frame.pitch_bytes % bytes == 0 && frame.samples.size() >= size_t(frame.pitch_bytes) * frame.height;
}

}  // namespace

CameraReader::CameraReader(Camera& camera, const CameraConfig& config, CameraReaderOptions options, RecordQueue& queue,
                           RecordMonitor& monitor, size_t index)
    : camera_(camera),
      config_(config),
      options_(std::move(options)),
      bits_(config),
      queue_(queue),
      monitor_(monitor),
      index_(index),
      backlog_max_(camera.buffers() + beside_buffers),
      beat_(monitor.stages().add(fmt::format("camera {} reader", index))),
      dropped_before_(camera.counts().dropped) {
    camera_.show_to(&look_);
    thread_ = std::thread([this] {
        const Status done = guarded("the camera cannot be read", [this] { return read(), Status(Done{}); });
        beat_.beat(StageActivity::ended);
        if (!done) queue_.push(CameraPause{0, {CameraState::gone, done.error().message}, disk_drops_, host_drops_});
    });
}

CameraReader::~CameraReader() {
    end_ = true;
    thread_.join();
    camera_.show_to(nullptr);
}

void CameraReader::read() {
    while (!end_) {
        count_drops();
        beat_.beat(StageActivity::waits_for_room);
        if (!take_place()) continue;
        beat_.beat();
        CameraState state = camera_.state();
        const bool is_live = state.kind == CameraState::live;
        const uint64_t watermark_ns = camera_.watermark_ns();
        look_.forget();
        auto frame = camera_.read(pause_ms);
        count_drops();
        frames_behind_disk_ -= frames_behind_disk_ > 0;
        if (frame) {
            enqueue(std::move(*frame));
            if (options_.room->waits_for_disk())
                frames_behind_disk_ = backlog_max_;  // it may have been spilled just now
            continue;
        }
        options_.room->give_back_place();
        // Nothing is left in its buffers. What it dropped before this, it may tell with the next frame, as late as that comes.
        frames_behind_disk_ = std::min<size_t>(frames_behind_disk_, 1);
        queue_.push(CameraPause{watermark_ns, std::move(state), disk_drops_, host_drops_});
        if (!is_live) return;
    }
}

// What holds the room is known while there is none. The camera may say how many it dropped only when the frame behind them is read, and
// that comes behind all that its buffers hold: by then the disk may long have gone on.
bool CameraReader::take_place() {
    if (options_.room->take_place(std::chrono::milliseconds(0))) return true;
    const auto look = [this] {
        if (options_.room->waits_for_disk() || (options_.waits_for_disk && options_.waits_for_disk()))
            frames_behind_disk_ = backlog_max_;
    };
    look();
    const bool has_place = options_.room->take_place(std::chrono::milliseconds(pause_ms));
    look();
    return has_place;
}

// The camera says how many it had no room for.
void CameraReader::count_drops() {
    const uint64_t more = camera_.counts().dropped - dropped_before_ - drops();
    if (more == 0) return;
    (frames_behind_disk_ > 0 ? disk_drops_ : host_drops_) += more;
    monitor_.change_camera(
        index_, [this](CameraProgress& camera) { camera.disk_drops = disk_drops_, camera.host_drops = host_drops_; });
}

// A sensor may saturate below the largest count of its format, and few cameras say where their black is: the stage does.
void CameraReader::take_levels(Frame& frame) const {
    if (frame.format != PixelFormat::u16) return;
    frame.black = float(options_.black_counts.value_or(config_.black));
    frame.white = std::min(frame.white, float(config_.white));
}

void CameraReader::enqueue(Frame frame) {
    FrameNews news;
    news.witness.arrival = arrivals_++;
    news.witness.stamp = frame.stamp;
    news.witness.disk_drops = disk_drops_, news.witness.host_drops = host_drops_;
    if (!is_whole(frame, config_)) {
        news.witness.unfit = {Cause::wrong_size, "its size or format is not the stage's"};
    } else {
        take_levels(frame);
        look_.complete(frame);
        news.witness.summary = look_.sums().summary(frame.black, config_.noise);
        news.bits = bits_.read(frame, look_.hash());
    }
    news.frame = options_.room->adopt(std::move(frame));
    monitor_.change_camera(index_, [](CameraProgress& camera) { ++camera.frames_received; });
    queue_.push(std::move(news));
}

}  // namespace ols
