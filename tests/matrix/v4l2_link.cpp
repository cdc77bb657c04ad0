// SPDX-License-Identifier: MIT
// A V4L2 camera: the driver on the model of the kernel that its unit tests have (tests/unit/v4l2_model.hpp).
#include <atomic>
#include <cstring>
#include <thread>

#include "../unit/v4l2_model.hpp"
#include "camera_link.hpp"
#include "device/v4l2_camera.hpp"

namespace ols::test {

namespace {

constexpr uint32_t buffers = 8;

class V4l2Link : public CameraLink {
  public:
    V4l2Link() {
        model_->formats = {{V4L2_PIX_FMT_Y12, "12-bit Greyscale"}};
        model_->buffer_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
        model_->buffers_max = buffers;
        model_->clock_ns = [this] { return now_ns_.load(); };
    }

    Result<std::unique_ptr<Camera>> open() override { return make_v4l2_camera(model_, "/dev/video7", 0); }
    bool can(FaultKind kind) const override {
        switch (kind) {
            case FaultKind::miss_trigger:
            case FaultKind::lose_frame:
            case FaultKind::cut_frame:
            case FaultKind::stale_buffer:
            case FaultKind::bad_time:
            case FaultKind::no_light:
            case FaultKind::restart: return true;
            // Buffers come out in the order of their count, all of the format that was set up; the clock is this machine's.
            default: return false;
        }
    }
    void set_now(uint64_t now_ns) override { now_ns_ = now_ns; }
    bool send(const Shot& shot, const std::atomic<bool>& in_haste) override {
        wait(in_haste);
        return expose(shot, 0, 0);
    }
    // In part: marked as damaged by its driver, or too short, in turn.
    void lose(const Shot& shot, bool in_part, const std::atomic<bool>& in_haste) override {
        wait(in_haste);
        if (!in_part) return;
        const bool is_marked = ++cut_ % 2 == 0;
        expose(shot, is_marked ? V4L2_BUF_FLAG_ERROR : 0, is_marked ? 0 : 32);
    }
    int room() const override { return int(buffers); }

  private:
    // A reader that is not late leaves the driver more than the buffers that it works with (device/v4l2_stamps.cpp).
    void wait(const std::atomic<bool>& in_haste) {
        while (!in_haste && model_->is_streaming() && model_->free_buffers() < buffers / 2) std::this_thread::yield();
    }
    bool expose(const Shot& shot, uint32_t flags, size_t bytes_short) {
        const bool has_room = model_->free_buffers() > 0;
        V4l2Model::Exposure exposure;
        exposure.flags = flags;
        exposure.bytes_short = bytes_short;
        exposure.bytes.resize(shot.samples.size() * sizeof(uint16_t));
        std::memcpy(exposure.bytes.data(), shot.samples.data(), exposure.bytes.size());
        exposure.clock_offset_ns = int64_t(shot.stamp.timestamp_ns - now_ns_);
        model_->set_sequence(uint32_t(shot.stamp.frame_id));
        model_->expose(exposure);
        return has_room;
    }

    std::shared_ptr<V4l2Model> model_ = std::make_shared<V4l2Model>();
    std::atomic<uint64_t> now_ns_ = 0;
    int cut_ = 0;
};

}  // namespace

std::unique_ptr<CameraLink> make_v4l2_link(const Scenario&) {
    return std::make_unique<V4l2Link>();
}

}  // namespace ols::test
