// SPDX-License-Identifier: MIT
// TriggerGrid: where on the grid of triggers a camera time lies. Triggers are evenly spaced; the camera's clock has an
// unknown offset and drifts.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

namespace ols {

class TriggerGrid {
  public:
    // A twentieth of a period: hardware timestamps jitter by a microsecond or less, and 23 us of 463 still tell triggers
    // apart with room for the drift over a pause.
    static constexpr double tolerance_periods = 0.05;
    static constexpr double drift_max = 1e-3;

    // `settle_triggers`: how far apart two frames must be before their times tell the drift better than not knowing it.
    TriggerGrid(double nominal_period_ns, uint64_t first_time_ns, uint64_t settle_triggers)
        : nominal_(nominal_period_ns),
          period_(nominal_period_ns),
          settle_(settle_triggers),
          first_ns_(first_time_ns),
          last_ns_(first_time_ns) {}

    // Triggers from the last frame to `time_ns`, at least 1; nothing when it falls between triggers or back.
    std::optional<uint64_t> steps_to(uint64_t time_ns) const {
        const double steps = double(int64_t(time_ns - last_ns_)) / period_;
        const double whole = std::round(steps);
        if (whole < 1 || std::abs(steps - whole) > tolerance_periods) return std::nullopt;
        return uint64_t(whole);
    }

    // Takes a frame that lies `steps` triggers after the last one; from two far apart the period is measured.
    void advance(uint64_t steps, uint64_t time_ns) {
        triggers_ += steps;
        last_ns_ = time_ns;
        if (triggers_ < settle_) return;
        const double measured = double(last_ns_ - first_ns_) / double(triggers_);
        if (std::abs(measured / nominal_ - 1) < drift_max) period_ = measured;
    }

    // When the trigger `steps` after the last frame's is due; steps may be negative.
    uint64_t time_after_ns(int64_t steps) const { return last_ns_ + uint64_t(std::llround(double(steps) * period_)); }

    double drift_ppm() const { return (period_ / nominal_ - 1) * 1e6; }

  private:
    double nominal_, period_;
    uint64_t settle_;
    uint64_t first_ns_, last_ns_;
    uint64_t triggers_ = 0;
};

}  // namespace ols
