// SPDX-License-Identifier: MIT
// From knots to intervals of even motion, for each place of a mosaic, and the rounding.
#include "capture/align.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

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

Alignment::Alignment(const MotionPath& path, int width, int height, Cfa cfa, float line_tolerance_px, int threads) {
    const std::vector<ColorPlace> places = color_places(cfa);
    if (path.size() == 1) {
        Interval& still = intervals_.emplace_back();
        still.first_tick = path[0].tick, still.last_tick = path[0].tick + 1;
        for (const ColorPlace& place : places)
            still.planes.emplace_back(FlowField(place.width(width), place.height(height)),
                                      FlowField(place.width(width), place.height(height)), line_tolerance_px);
        still.confidence.assign(size_t(width) * size_t(height), 0.0f);
        return;
    }
    std::vector<std::vector<float>> confidences(path.size());
    for_each_index(threads, path.size(),
                   [&](size_t k) { confidences[k] = enlarged(path[k].confidence, path[k].flow, width, height); });
    intervals_.resize(path.size() - 1);
    for_each_index(threads, intervals_.size(), [&](size_t k) {
        Interval& interval = intervals_[k];
        interval.first_tick = path[k].tick, interval.last_tick = path[k + 1].tick;
        const FlowField step = difference(path[k + 1].flow, path[k].flow);
        for (const ColorPlace& place : places)
            interval.planes.emplace_back(path[k].flow, step,
                                         PlaneGrid{width, height, place.step, place.first_x, place.first_y},
                                         line_tolerance_px);
        interval.confidence.resize(confidences[k].size());
        std::ranges::transform(confidences[k], confidences[k + 1], interval.confidence.begin(),
                               [](float a, float b) { return std::min(a, b); });
    });
}

Alignment::Place Alignment::place_of(double tick) const {
    size_t i = 0;
    while (i + 1 < intervals_.size() && intervals_[i].last_tick <= tick) ++i;
    const Interval& interval = intervals_[i];
    return {i, float((tick - interval.first_tick) / (interval.last_tick - interval.first_tick))};
}

}  // namespace ols
