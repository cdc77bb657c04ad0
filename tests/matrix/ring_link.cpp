// SPDX-License-Identifier: MIT
// A ring of shared memory, written to as a camera's program does.
#include <cstring>

#include "camera_link.hpp"
#include "device/ring.hpp"

namespace ols::test {

namespace {

constexpr uint32_t ring_slots = 64;

class RingLink : public CameraLink {
  public:
    RingLink(const Scenario& scenario, std::string path) : path_(std::move(path)) {
        RingContent content;
        content.width = uint32_t(scenario.width), content.height = uint32_t(scenario.height), content.bits = 12;
        writer_.emplace(std::move(*RingWriter::create(path_, ring_slots, content)));
    }

    Result<std::unique_ptr<Camera>> open() override { return open_camera("ring:" + path_); }
    void serve() override {
        if (const auto start = writer_->start_asked()) writer_->confirm_start(*start, now_ns_);
    }
    bool can(FaultKind kind) const override { return kind != FaultKind::cut_frame; }  // a frame goes in whole
    void set_now(uint64_t now_ns) override {
        now_ns_ = now_ns;
        writer_->set_watermark(now_ns);
    }
    bool send(const Shot& shot, const std::atomic<bool>& in_haste) override {
        Frame frame;
        frame.stamp = shot.stamp;
        frame.width = shot.width, frame.height = shot.height;
        frame.pitch_bytes = shot.width * uint32_t(sizeof(uint16_t));
        frame.samples.resize(size_t(frame.pitch_bytes) * frame.height);
        std::memcpy(frame.samples.data(), shot.samples.data(), frame.samples.size());
        auto outcome = RingWriter::Outcome::cancelled;
        if (!in_haste) outcome = writer_->write(frame, true, in_haste);
        if (outcome == RingWriter::Outcome::cancelled) outcome = writer_->write(frame, false, in_haste);
        return outcome != RingWriter::Outcome::full;
    }
    void lose(const Shot&, bool, const std::atomic<bool>&) override {}
    int room() const override { return int(ring_slots); }

  private:
    const std::string path_;
    std::optional<RingWriter> writer_;
    uint64_t now_ns_ = 0;
};

}  // namespace

std::unique_ptr<CameraLink> make_ring_link(const Scenario& scenario, const std::string& work) {
    return std::make_unique<RingLink>(scenario, work + "/matrix.ring");
}

}  // namespace ols::test
