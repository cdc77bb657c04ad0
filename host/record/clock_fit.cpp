// SPDX-License-Identifier: MIT
// Least squares of one clock against another.
#include "record/clock_fit.hpp"

#include <algorithm>
#include <cmath>

#include "stage/sequence.hpp"

namespace ols {

namespace {

constexpr double ns_per_tick = 1e9 / tick_hz;

}  // namespace

nlohmann::json clock_record(const ClockRelation& relation) {
    return {{"samples", relation.samples},       {"offset_ns", relation.offset_ns},
            {"drift_ppm", relation.drift_ppm},   {"drift_error_ppm", relation.drift_error_ppm},
            {"scatter_ns", relation.scatter_ns}, {"bound_ns", relation.bound_ns}};
}

// Welford's recurrence, for a line. What is left beside the line grows by what the line so far did not foretell of each sample, a sum
// of squares, as its difference from the sums about the means would be lost in their rounding after minutes.
void ClockFit::add(uint64_t ticks, uint64_t ns) {
    if (count_ == 0) first_ticks_ = ticks, first_ns_ = ns;
    const double x = double(int64_t(ticks - first_ticks_)) * ns_per_tick;
    const double y = double(int64_t(ns - first_ns_)) - x;
    const double dx = x - mean_x_, dy = y - mean_y_;
    if (sum_xx_ > 0) {
        const double surprise = dy - sum_xy_ / sum_xx_ * dx;
        rest_ += surprise * surprise / (1 + 1 / double(count_) + dx * dx / sum_xx_);
    }
    ++count_;
    mean_x_ += dx / double(count_);
    mean_y_ += dy / double(count_);
    sum_xx_ += dx * (x - mean_x_);
    sum_xy_ += dx * (y - mean_y_);
}

std::optional<ClockRelation> ClockFit::relation() const {
    if (count_ < 3 || sum_xx_ <= 0) return std::nullopt;
    const double slope = sum_xy_ / sum_xx_;
    ClockRelation relation;
    relation.samples = count_;
    relation.drift_ppm = slope * 1e6;
    relation.drift_error_ppm = std::sqrt(rest_ / double(count_ - 2) / sum_xx_) * 1e6;
    relation.scatter_ns = std::sqrt(rest_ / double(count_ - 2));
    const double first_ns = double(first_ticks_) * ns_per_tick;  // from tick 0, by the board's clock
    const double ahead_ns = mean_y_ - slope * mean_x_ - slope * first_ns;
    relation.offset_ns = int64_t(first_ns_) + std::llround(ahead_ns - first_ns);
    return relation;
}

void HostClock::take(ClockFit& fit, const Exchange& exchange) {
    fit.add(exchange.ticks, exchange.asked_ns + exchange.duration_ns / 2);
}

void HostClock::add(uint64_t asked_ns, uint64_t answered_ns, uint64_t ticks) {
    if (!stretch_begin_ns_) stretch_begin_ns_ = asked_ns;
    if (asked_ns - *stretch_begin_ns_ >= stretch_ns && best_.duration_ns != UINT64_MAX) {
        take(fit_, best_);
        slowest_ns_ = std::max(slowest_ns_, best_.duration_ns);
        best_ = {};
        stretch_begin_ns_ = asked_ns;
    }
    const uint64_t duration_ns = answered_ns - asked_ns;
    if (duration_ns < best_.duration_ns) best_ = {asked_ns, duration_ns, ticks};
}

std::optional<ClockRelation> HostClock::relation() const {
    ClockFit fit = fit_;
    uint64_t slowest_ns = slowest_ns_;
    // The last stretch, which may have had few, only where there are few others.
    if (!fit.relation() && best_.duration_ns != UINT64_MAX) {
        take(fit, best_);
        slowest_ns = std::max(slowest_ns, best_.duration_ns);
    }
    auto relation = fit.relation();
    if (relation) relation->bound_ns = double(slowest_ns) / 2;
    return relation;
}

}  // namespace ols
