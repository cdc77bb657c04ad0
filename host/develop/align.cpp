// SPDX-License-Identifier: MIT
// From knots to intervals of even motion, and the rounding.
#include "develop/align.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "develop/signal_planes.hpp"
#include "parallel.hpp"

namespace ols {

namespace {

FlowField difference(const FlowField& a, const FlowField& b) {
    FlowField out(a.width, a.height);
    for (size_t p = 0; p < out.size(); ++p) out.u[p] = a.u[p] - b.u[p], out.v[p] = a.v[p] - b.v[p];
    return out;
}

std::vector<float> enlarged(const std::vector<float>& values, const FlowField& like, int width, int height) {
    if (like.width == width && like.height == height) return values;
    std::vector<float> out(size_t(width) * size_t(height));
    cv::Mat target(height, width, CV_32F, out.data());
    cv::resize(cv::Mat(like.height, like.width, CV_32F, const_cast<float*>(values.data())), target, target.size(), 0, 0,
               cv::INTER_LINEAR);
    return out;
}

}  // namespace

void align_samples(std::span<const float> samples, std::span<int32_t> aligned) {
    assert(samples.size() == aligned.size());
    for (size_t i = 0; i < samples.size(); ++i) aligned[i] = int32_t(samples[i] + std::copysign(0.5f, samples[i]));
}

Alignment::Alignment(const MotionPath& path, int width, int height, Cfa cfa, float line_tolerance_steps, int threads) {
    const SampleGrid grid = sample_grid(width, height, cfa);
    if (path.size() == 1) {
        const FlowField still(width, height);
        intervals_.push_back({path[0].tick, path[0].tick + 1, {still, still, grid, line_tolerance_steps}, {}});
        intervals_[0].confidence.assign(still.size(), 0.0f);
        moves_.resize(still.size());
        return;
    }
    std::vector<std::optional<Interval>> made(path.size() - 1);
    for_each_index(threads, made.size(), [&](size_t k) {
        const MotionKnot &first = path[k], &last = path[k + 1];
        std::vector<float> worse(first.confidence.size());
        std::ranges::transform(first.confidence, last.confidence, worse.begin(),
                               [](float a, float b) { return std::min(a, b); });
        made[k] = Interval{first.tick,
                           last.tick,
                           {first.flow, difference(last.flow, first.flow), grid, line_tolerance_steps},
                           enlarged(worse, first.flow, width, height)};
    });
    for (auto& interval : made) intervals_.push_back(std::move(*interval));
    moves_.resize(size_t(width) * size_t(height));
    for (const Interval& interval : intervals_) interval.motion.mark_moving(moves_);
}

Alignment::Place Alignment::place_of(double tick) const {
    size_t i = 0;
    while (i + 1 < intervals_.size() && intervals_[i].last_tick <= tick) ++i;
    const Interval& interval = intervals_[i];
    return {i, float((tick - interval.first_tick) / (interval.last_tick - interval.first_tick)), tick};
}

}  // namespace ols
