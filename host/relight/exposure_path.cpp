// SPDX-License-Identifier: MIT
#include "relight/exposure_path.hpp"

#include <algorithm>

namespace ols {

namespace {

// An instant of the motion or, without a flow, the target's own.
struct Knot {
    double time_s;
    const FlowField* flow;
};

std::vector<Knot> knots_of(const TargetMotion& motion) {
    std::vector<Knot> knots = {{0, nullptr}};
    for (size_t i = 0; i < motion.times_s.size(); ++i) knots.push_back({motion.times_s[i], &motion.flows[i]});
    std::sort(knots.begin(), knots.end(), [](const Knot& a, const Knot& b) { return a.time_s < b.time_s; });
    return knots;
}

void add_scaled(std::vector<float>& sum, const std::vector<float>& values, float weight) {
    for (size_t p = 0; p < sum.size(); ++p) sum[p] += weight * values[p];
}

// On the line through the two knots around a time, or through the outermost two.
FlowField moved_at(const std::vector<Knot>& knots, double time_s, int width, int height) {
    size_t after = 1;
    while (after + 1 < knots.size() && knots[after].time_s <= time_s) ++after;
    const Knot &a = knots[after - 1], &b = knots[after];
    const double fraction = (time_s - a.time_s) / (b.time_s - a.time_s);
    FlowField moved(width, height);
    for (const auto& [knot, weight] : {std::pair{a, 1 - fraction}, {b, fraction}}) {
        if (!knot.flow || weight == 0) continue;
        add_scaled(moved.u, knot.flow->u, float(weight));
        add_scaled(moved.v, knot.flow->v, float(weight));
    }
    return moved;
}

}  // namespace

ExposurePath exposure_path(const TargetMotion& motion, double open_s, double close_s) {
    const auto knots = knots_of(motion);
    ExposurePath path;
    path.times_s = {open_s};
    for (const Knot& knot : knots)
        if (knot.time_s > open_s && knot.time_s < close_s) path.times_s.push_back(knot.time_s);
    path.times_s.push_back(close_s);
    for (const double time_s : path.times_s)
        path.moved.push_back(moved_at(knots, time_s, motion.flows[0].width, motion.flows[0].height));
    path.extrapolated_s = std::max({0.0, knots.front().time_s - open_s, close_s - knots.back().time_s});
    return path;
}

}  // namespace ols
