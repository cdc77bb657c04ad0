// SPDX-License-Identifier: MIT
// Blurring and resampling of images; from level to level.
#include "flow/flow_pyramid.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace ols {

namespace {

cv::Mat mat_of(const Image& image) {
    return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
}

Image reduced(const Image& image, double ratio) {
    // What half resolution cannot carry is taken out by sigma 0.9; a level of another ratio widens the blur of the one before
    // by as much as its pixels grow: sigma^2 goes as 1 / ratio^2 - 1.
    const double sigma = 0.9 * std::sqrt((1 / (ratio * ratio) - 1) / 3);
    const auto shrunk = [&](int side) { return std::max(1, int(std::lround(side * ratio))); };
    cv::Mat blurred;
    cv::GaussianBlur(mat_of(image), blurred, {0, 0}, sigma, sigma, cv::BORDER_REPLICATE);
    Image out(shrunk(image.width), shrunk(image.height), 1);
    cv::Mat small = mat_of(out);
    cv::resize(blurred, small, small.size(), 0, 0, cv::INTER_LINEAR);
    return out;
}

Image smoothed(const Image& image, float sigma) {
    Image out(image.width, image.height, 1);
    cv::Mat target = mat_of(out);
    cv::GaussianBlur(mat_of(image), target, {0, 0}, sigma, sigma, cv::BORDER_REPLICATE);
    return out;
}

// Takes the coarse part out, in place. The standard deviation of what is left of both images.
double leave_detail(FlowPair& pair, const FlowDetail& detail) {
    const int side = 2 * detail.radius + 1;
    double variance = 0;
    for (Image* image : {&pair.from, &pair.to}) {
        cv::Mat fine = mat_of(*image), coarse;
        cv::boxFilter(fine, coarse, -1, {side, side}, {-1, -1}, true, cv::BORDER_REPLICATE);
        cv::boxFilter(coarse, coarse, -1, {side, side}, {-1, -1}, true, cv::BORDER_REPLICATE);
        cv::scaleAdd(coarse, -detail.share, fine, fine);
        cv::Scalar mean, deviation;
        cv::meanStdDev(fine, mean, deviation);
        variance += deviation[0] * deviation[0] / 2;
    }
    return std::sqrt(variance);
}

void multiply(Image& image, double scale) {
    constexpr double step = 1 << 6;  // rounds to some 4e-6: what filters leave where nothing is becomes zero
    cv::Mat values = mat_of(image);
    values.convertTo(values, -1, scale, step);
    cv::subtract(values, cv::Scalar(step), values);
}

// Each level on a scale of its own, both images on one: a subject that enters must not change that of what was there. But a
// level that has much less detail than the richest is not blown up to noise; images without detail become zero.
void take_detail(std::vector<FlowPair>& levels, const FlowDetail& detail) {
    constexpr double poorest = 0.3;  // of the richest level
    std::vector<double> spreads;
    for (FlowPair& level : levels) spreads.push_back(leave_detail(level, detail));
    const double least = poorest * *std::max_element(spreads.begin(), spreads.end());
    for (size_t i = 0; i < levels.size(); ++i)
        for (Image* image : {&levels[i].from, &levels[i].to})
            multiply(*image, least > 0 ? 1 / std::max(spreads[i], least) : 0);
}

FlowPair reduced(const FlowPair& pair, double ratio) {
    const auto seen = [&](const Image& mask) { return mask.data.empty() ? Image() : reduced(mask, ratio); };
    return {reduced(pair.from, ratio), reduced(pair.to, ratio), seen(pair.from_seen), seen(pair.to_seen)};
}

}  // namespace

FlowPyramid flow_pyramid(const FlowPair& pair, const FlowLevels& which, const FlowDetail& detail) {
    assert(pair.from.channels == 1 && pair.to.channels == 1 && pair.from.width == pair.to.width &&
           pair.from.height == pair.to.height && which.ratio > 0 && which.ratio < 1);
    FlowPyramid pyramid{.width = pair.from.width, .height = pair.from.height, .levels = {pair}};
    if (detail.smoothing > 0)
        for (Image* image : {&pyramid.levels[0].from, &pyramid.levels[0].to})
            *image = smoothed(*image, detail.smoothing);
    const double above_finest = std::ceil(which.octaves * std::log(0.5) / std::log(which.ratio) - 1e-9);
    int finer_left = which.finest;
    while (finer_left > 0 || double(pyramid.levels.size()) <= above_finest) {
        const FlowPair& last = pyramid.levels.back();
        const int side = std::min(last.from.width, last.from.height);
        const int next = int(std::lround(side * which.ratio));
        if (next < which.coarsest || next == side) break;
        FlowPair smaller = reduced(last, which.ratio);
        if (finer_left-- > 0) pyramid.levels.clear();
        pyramid.levels.push_back(std::move(smaller));
    }
    take_detail(pyramid.levels, detail);
    return pyramid;
}

FlowField coarse_to_fine(const FlowPyramid& pyramid, const FlowField* initial, const SolveLevel& solve) {
    const auto& levels = pyramid.levels;
    FlowField flow = initial ? *initial : FlowField(levels.back().from.width, levels.back().from.height);
    for (size_t level = levels.size(); level-- > 0;)
        flow = solve(level, resized(flow, levels[level].from.width, levels[level].from.height));
    return resized(flow, pyramid.width, pyramid.height);
}

void median_filter(FlowField& flow) {
    for (std::vector<float>* plane : {&flow.u, &flow.v}) {
        cv::Mat filtered(flow.height, flow.width, CV_32F);
        cv::medianBlur(cv::Mat(flow.height, flow.width, CV_32F, plane->data()), filtered, 5);
        std::copy_n(filtered.ptr<float>(), plane->size(), plane->begin());
    }
}

}  // namespace ols
