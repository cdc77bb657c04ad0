// SPDX-License-Identifier: MIT
// Steps between 16-bit ids, and how often they went round.
#include "device/frame_id_count.hpp"

#include <cmath>

namespace ols {

namespace {

// Frames come evenly while the time of a step is within so much of the stretch's mean.
constexpr double even_tolerance = 0.2;
// Of the time of many steps, by that of the stretch: clocks of cameras are steady to some parts in a million, stamps jitter by
// microseconds.
constexpr double period_tolerance = 2e-5;
constexpr uint64_t stretch_min = 100;  // steps, before a period is known so well

}  // namespace

uint64_t FrameIdCount::unwrap(const CameraStamp& stamp) {
    const uint64_t id = stamp.frame_id;
    is_wide_ = is_wide_ || id > UINT16_MAX;
    if (id == 0) count_ = 65536;  // a device that does not skip it
    if (!last_ || is_wide_) {
        last_ = stamp;
        return unwrapped_ = id;
    }
    const uint64_t ahead = (id + count_ - last_->frame_id) % count_;
    if (stamp.timestamp_ns < last_->timestamp_ns) {
        const uint64_t back = (count_ - ahead) % count_;
        return unwrapped_ > back ? unwrapped_ - back : id;
    }
    const uint64_t ns = stamp.timestamp_ns - last_->timestamp_ns;
    const uint64_t steps = ahead + wraps_between(ahead, ns) * count_;
    measure(steps, ns);
    last_ = stamp;
    return unwrapped_ += steps;
}

uint64_t FrameIdCount::wraps_between(uint64_t steps, uint64_t ns) const {
    if (even_steps_ < stretch_min) return 0;
    const double fit = double(ns) / (double(even_ns_) / double(even_steps_));
    const double wraps = std::round((fit - double(steps)) / double(count_));
    if (wraps < 1) return 0;
    const double apart = double(steps) + wraps * double(count_);
    return std::abs(fit - apart) <= 1 + apart * period_tolerance ? uint64_t(wraps) : 0;
}

void FrameIdCount::measure(uint64_t steps, uint64_t ns) {
    if (steps == 0) return;
    const double step_ns = double(ns) / double(steps);
    const double mean_ns = even_steps_ > 0 ? double(even_ns_) / double(even_steps_) : step_ns;
    if (std::abs(step_ns - mean_ns) > even_tolerance * mean_ns) {
        // The pause itself says nothing; frames after it, if they come otherwise than before, begin another stretch.
        if (step_ns < mean_ns) even_steps_ = steps, even_ns_ = ns;
        return;
    }
    even_steps_ += steps;
    even_ns_ += ns;
}

}  // namespace ols
