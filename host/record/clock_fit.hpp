// SPDX-License-Identifier: MIT
// One clock: how another clock, a camera's or this machine's, runs beside the board's ticks, and how surely that is known.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>

namespace ols {

// A line through (ticks, nanoseconds): ns = offset_ns + ticks * 8 * (1 + drift_ppm * 1e-6).
struct ClockRelation {
    uint64_t samples = 0;
    int64_t offset_ns = 0;                      // the other clock's time at tick 0
    double drift_ppm = 0, drift_error_ppm = 0;  // and its standard error, from how the samples scatter
    double scatter_ns = 0;                      // root mean square of a sample's distance from the line
    double bound_ns = 0;                        // by which all of it may be shifted; 0 for stamps of hardware
};

nlohmann::json clock_record(const ClockRelation& relation);

// Least squares, sample by sample; nothing is kept of them. Sums are taken relative to the first sample, so that an hour of ticks
// loses nothing in them (1 ns in 1e13).
class ClockFit {
  public:
    void add(uint64_t ticks, uint64_t ns);

    // Nothing with fewer than three samples, which say nothing of their scatter, or when all are of one time.
    std::optional<ClockRelation> relation() const;

  private:
    uint64_t first_ticks_ = 0, first_ns_ = 0;
    uint64_t count_ = 0;
    double mean_x_ = 0, mean_y_ = 0;  // nanoseconds by the board's clock; and how much the other is ahead of it
    double sum_xx_ = 0, sum_xy_ = 0;  // about the means
    double rest_ = 0;                 // squares beside the line
};

// The machine's clock, from exchanges: the board told its time some time between a question and its answer. Of each stretch of
// time the quickest exchange counts, which errs by half its duration at most.
class HostClock {
  public:
    void add(uint64_t asked_ns, uint64_t answered_ns, uint64_t ticks);
    std::optional<ClockRelation> relation() const;

  private:
    static constexpr uint64_t stretch_ns = 250'000'000;
    struct Exchange {
        uint64_t asked_ns = 0, duration_ns = UINT64_MAX, ticks = 0;
    };
    static void take(ClockFit& fit, const Exchange& exchange);

    std::optional<uint64_t> stretch_begin_ns_;
    Exchange best_;            // of the stretch
    uint64_t slowest_ns_ = 0;  // of those that counted
    ClockFit fit_;
};

}  // namespace ols
