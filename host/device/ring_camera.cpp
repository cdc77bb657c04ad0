// SPDX-License-Identifier: MIT
// Camera over RingReader. The program that fills the ring has set its camera up; here that is only checked.
#include "device/ring_camera.hpp"

#include <chrono>

#include "device/delivery_count.hpp"
#include "device/ring.hpp"

namespace ols {

namespace {

class RingCamera : public Camera {
  public:
    RingCamera(RingReader ring, std::string path, uint32_t index)
        : ring_(std::move(ring)), path_(std::move(path)), index_(index) {}

    // Without its path: the same take gives the same archive on any machine.
    CameraInfo info() const override { return {"camera ring", link_text(), in_force_, 1}; }

    Status set_up(const CameraSetup& wanted) override {
        const RingContent& content = ring_.content();
        in_force_ = {};
        in_force_.width = int(content.width);
        in_force_.height = int(content.height);
        in_force_.cfa = content.cfa;
        in_force_.bits = content.format == PixelFormat::u16 ? int(content.bits) : wanted.bits;  // floats have all
        return check_setup("the camera at ring:" + path_, wanted, in_force_,
                           {"trigger_source", "trigger_activation", "trigger_delay_us", "exposure_mode"});
    }

    Result<uint64_t> start() override {
        const auto started_ns = ring_.start(device_patience_ms);
        if (started_ns.ok()) delivery_.start(*started_ns);
        return started_ns;
    }
    void stop() override { ring_.stop(); }

    std::optional<Frame> read(int timeout_ms) override {
        using Clock = std::chrono::steady_clock;
        const auto until = Clock::now() + std::chrono::milliseconds(timeout_ms);
        // Stale frames do not prolong the wait, be there ever so many.
        for (auto left = std::chrono::milliseconds(timeout_ms);;) {
            auto frame =
                ring_.read(int(left.count()), [this](const std::byte* samples, Frame& to) { copy_rows(samples, to); });
            if (!frame) return std::nullopt;
            if (delivery_.take(frame->stamp)) {
                frame->camera = index_;
                return frame;
            }
            left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
            if (left.count() < 0) return std::nullopt;
        }
    }

    uint64_t watermark_ns() const override { return ring_.watermark_ns(); }

    CameraCounts counts() const override {
        CameraCounts counts = delivery_.counts();
        counts.dropped = ring_.dropped();
        return counts;
    }

    size_t buffers() const override { return ring_.slots(); }

    CameraState state() const override {
        switch (ring_.writer()) {
            case RingReader::Writer::live: return {};
            case RingReader::Writer::closed:
                return {CameraState::ended, "the program that fills " + path_ + " has ended"};
            case RingReader::Writer::broken:
                return {CameraState::gone, "the camera is gone: the ring " + path_ + " is broken, " + ring_.problem() +
                                               ": start the program that fills it again"};
            case RingReader::Writer::gone: break;
        }
        return {CameraState::gone,
                "the camera is gone: the program that fills " + path_ + " ended without a word; start it again"};
    }

  private:
    std::string link_text() const { return "shared-memory ring of " + std::to_string(ring_.slots()) + " frames"; }

    RingReader ring_;
    const std::string path_;
    const uint32_t index_;
    CameraSetup in_force_;
    DeliveryCount delivery_;
};

}  // namespace

Result<std::unique_ptr<Camera>> open_ring_camera(const std::string& path, uint32_t index) {
    auto ring = RingReader::open(path);
    if (!ring.ok()) return ring.error();
    return std::unique_ptr<Camera>(std::make_unique<RingCamera>(std::move(*ring), path, index));
}

}  // namespace ols
