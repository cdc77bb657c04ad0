// SPDX-License-Identifier: MIT
// The camera's time, carried on by the host's clock.
#include "device/camera_clock.hpp"

#include <algorithm>

namespace ols {

namespace {

// Two clocks differ by some tens of parts in a million: a camera's time is never thought to be later than it is.
constexpr double rate_max = 0.999;
constexpr uint64_t rate_span_ns = 50'000'000;  // between two answers that tell the rate

}  // namespace

void CameraClock::start(std::optional<uint64_t> camera_ns, uint64_t host_ns) {
    const std::lock_guard lock(mutex_);
    can_be_asked_ = camera_ns.has_value();
    camera_ns_ = camera_ns.value_or(0);
    host_ns_ = host_ns;
    rate_ = rate_max;
    delivery_ns_ = delivery_ns;
    watermark_ns_ = 0;
}

void CameraClock::asked(uint64_t camera_ns, uint64_t host_ns) {
    const std::lock_guard lock(mutex_);
    if (host_ns < host_ns_ + rate_span_ns) return;
    // A clock need not run as the wall's does: the virtual stage's has its own time.
    const double ran_ns = double(int64_t(camera_ns - camera_ns_));
    rate_ = std::clamp(ran_ns / double(host_ns - host_ns_), 0.0, rate_max);
    camera_ns_ = camera_ns;
    host_ns_ = host_ns;
}

void CameraClock::frame_came(uint64_t camera_ns, uint64_t host_ns) {
    const std::lock_guard lock(mutex_);
    const double late_ns = camera_ns_at(host_ns) - double(camera_ns);
    if (can_be_asked_) {
        if (rate_ > 0) delivery_ns_ = std::max(delivery_ns_, uint64_t(std::max(0.0, 2 * late_ns / rate_)));
    } else if (late_ns < 0) {
        camera_ns_ = camera_ns;
        host_ns_ = host_ns;
    }
}

double CameraClock::camera_ns_at(uint64_t host_ns) const {
    return double(camera_ns_) + rate_ * double(int64_t(host_ns - host_ns_));
}

uint64_t CameraClock::watermark_ns(uint64_t host_ns) {
    const std::lock_guard lock(mutex_);
    const double came_ns = camera_ns_at(host_ns - delivery_ns_);
    watermark_ns_ = std::max(watermark_ns_, uint64_t(std::max(0.0, came_ns)));
    return watermark_ns_;
}

}  // namespace ols
