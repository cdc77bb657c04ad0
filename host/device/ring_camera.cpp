// SPDX-License-Identifier: MIT
// A camera whose frames another process writes into a shared-memory ring.
#include "device/camera.hpp"
#include "device/ring.hpp"

namespace ols {

namespace {

class RingCamera : public Camera {
  public:
    explicit RingCamera(RingReader ring) : ring_(std::move(ring)) {}

    std::optional<Frame> read(int timeout_ms) override { return ring_.read(timeout_ms); }
    uint64_t watermark_ns() const override { return ring_.watermark_ns(); }
    uint64_t dropped() const override { return ring_.dropped(); }
    bool closed() const override { return ring_.closed(); }

  private:
    RingReader ring_;
};

}  // namespace

Result<std::unique_ptr<Camera>> open_camera(const std::string& source) {
    constexpr std::string_view ring_scheme = "ring:";
    if (!source.starts_with(ring_scheme)) return fail("'" + source + "' is no camera: write ring:PATH");
    auto ring = RingReader::open(source.substr(ring_scheme.size()));
    if (!ring.ok()) return ring.error();
    return std::unique_ptr<Camera>(std::make_unique<RingCamera>(std::move(*ring)));
}

}  // namespace ols
