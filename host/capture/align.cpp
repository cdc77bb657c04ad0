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

// Shortens the vectors that lead outside the image so that they end on its edge.
void hold_inside(FlowField& flow) {
    for (int y = 0; y < flow.height; ++y)
        for (int x = 0; x < flow.width; ++x) {
            const size_t at = size_t(y) * size_t(flow.width) + size_t(x);
            flow.u[at] = std::clamp(flow.u[at], -float(x), float(flow.width - 1 - x));
            flow.v[at] = std::clamp(flow.v[at], -float(y), float(flow.height - 1 - y));
        }
}

FlowField difference(const FlowField& a, const FlowField& b) {
    FlowField out(a.width, a.height);
    for (size_t p = 0; p < out.size(); ++p) out.u[p] = a.u[p] - b.u[p], out.v[p] = a.v[p] - b.v[p];
    return out;
}

FlowField of_place(const FlowField& flow, const ColorPlace& place) {
    FlowField out = place.step == 1 ? flow : of_color_plane(flow, place.first_x, place.first_y);
    hold_inside(out);
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
    // Each knot's flow at each colour's places.
    std::vector<std::vector<FlowField>> flows(path.size());
    std::vector<std::vector<float>> confidences(path.size());
    for_each_index(threads, path.size(), [&](size_t k) {
        const FlowField full = resized(path[k].flow, width, height);
        for (const ColorPlace& place : places) flows[k].push_back(of_place(full, place));
        confidences[k] = enlarged(path[k].confidence, path[k].flow, width, height);
    });
    intervals_.resize(path.size() - 1);
    for_each_index(threads, intervals_.size(), [&](size_t k) {
        Interval& interval = intervals_[k];
        interval.first_tick = path[k].tick, interval.last_tick = path[k + 1].tick;
        for (size_t i = 0; i < places.size(); ++i)
            interval.planes.emplace_back(flows[k][i], difference(flows[k + 1][i], flows[k][i]), line_tolerance_px);
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
