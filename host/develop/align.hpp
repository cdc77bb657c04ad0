// SPDX-License-Identifier: MIT
// Align: brings the calibrated samples of a slot to the target's time, before they are demultiplexed (Wenger section 6).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "develop/group_motion.hpp"
#include "develop/tracking_flows.hpp"
#include "image/frame.hpp"

namespace ols {

// Rounds aligned samples (counts above black) to the signed integer counts that the exact inversion sums, half away from
// zero. For a subject that does not move, aligned samples are the camera's own, whole counts less a whole black level,
// and pass unchanged. |samples| < 2^31.
void align_samples(std::span<const float> samples, std::span<int32_t> aligned);

// The middle of an exposure: what motion in a frame is a mean about.
inline double middle_tick(const Frame& frame) {
    return double(frame.tick) + 0.5 * double(frame.exposure_ticks);
}

// A pixel whose confidence (flow.hpp) is less has a flow that misses by more than is allowed.
constexpr float trusted_confidence = 0.5f;

// Where a target's pixels are found at other times, made ready for the samples of its frames. What leads outside the image takes
// its edge, and is not trusted.
class Alignment {
  public:
    // `path` has the target's instant among its knots. line_tolerance_steps: GroupMotion's.
    Alignment(const MotionPath& path, int width, int height, Cfa cfa, float line_tolerance_steps, int threads);

    // Between two knots the subject moves evenly; beyond the first and the last it goes on as before. A path of a single
    // knot says nothing of motion: one interval, in which all stands still and nothing is trusted.
    struct Place {
        size_t interval = 0;
        float fraction = 0;  // of the interval that has passed; below 0 or above 1 beyond
        double tick = 0;
    };
    Place place_of(double tick) const;

    const GroupMotion& motion(size_t interval) const { return intervals_[interval].motion; }
    // Of each pixel of the target, the lower of the interval's two knots.
    const std::vector<float>& confidence(size_t interval) const { return intervals_[interval].confidence; }
    size_t intervals() const { return intervals_.size(); }
    // Of each pixel: not 0 where motion in any interval leads anywhere else.
    const std::vector<uint8_t>& moves() const { return moves_; }

  private:
    struct Interval {
        double first_tick, last_tick;
        GroupMotion motion;
        std::vector<float> confidence;
    };
    std::vector<Interval> intervals_;
    std::vector<uint8_t> moves_;
};

}  // namespace ols
