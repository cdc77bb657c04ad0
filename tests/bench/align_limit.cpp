// SPDX-License-Identifier: MIT
// Pictures of single moments, moved onto another one.
#include "align_limit.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "align_score.hpp"
#include "renderer.hpp"

namespace ols {

namespace {

Image moved(const Image& image, const FlowField& flow) {
    const cv::Mat from(image.height, image.width, CV_32FC3, const_cast<float*>(image.data.data()));
    cv::Mat x(from.size(), CV_32F), y(from.size(), CV_32F);
    for (int p = 0; p < int(flow.size()); ++p) {
        x.at<float>(p / image.width, p % image.width) = float(p % image.width) + flow.u[size_t(p)];
        y.at<float>(p / image.width, p % image.width) = float(p / image.width) + flow.v[size_t(p)];
    }
    Image out(image.width, image.height, 3);
    cv::Mat to(from.size(), CV_32FC3, out.data.data());
    cv::remap(from, to, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    return out;
}

std::vector<unsigned char> eroded(std::vector<unsigned char> mask, int width, int height) {
    constexpr int margin = 3;
    cv::Mat out;
    cv::erode(cv::Mat(height, width, CV_8U, mask.data()), out,
              cv::getStructuringElement(cv::MORPH_RECT, {2 * margin + 1, 2 * margin + 1}));
    return {out.begin<unsigned char>(), out.end<unsigned char>()};
}

}  // namespace

AlignLimit::AlignLimit(const Recording& recording, const MotionPath& true_path) {
    Renderer renderer({recording.scene, recording.stage, recording.camera(), false}, {});
    std::vector<Float3> weights(renderer.lamp_count());
    for (size_t lamp = 0; lamp < recording.stage.lamps.size(); ++lamp) {
        const auto w = float(lightings()[0].weight(recording.stage.lamps[lamp].direction));
        weights[lamp] = {w, w, w};
    }
    const double at_us = recording.target_us(0);
    truth_ = renderer.light(weights, at_us);
    const double at_tick = MotionDeveloper::instant_of(recording.targets[0], recording.sequence);
    for (const MotionKnot& knot : true_path) {
        const double knot_us = at_us + (knot.tick - at_tick) / double(tick_hz) * 1e6;
        others_.push_back(knot.is_instant ? Image() : renderer.light(weights, knot_us));
        visible_.emplace_back(knot.confidence.begin(), knot.confidence.end());
        inside_.push_back(eroded(visible_.back(), truth_.width, truth_.height));
    }
    peak_ = percentile(truth_.data, 0.999);
}

template <typename Moved>
double AlignLimit::psnr_db(const Moved& moved_to, Where where) const {
    double squares = 0, count = 0;
    for (size_t k = 0; k < others_.size(); ++k) {
        if (others_[k].data.empty()) continue;
        const std::vector<unsigned char>& counts = where == Where::inside ? inside_[k] : visible_[k];
        const Image other = moved_to(k);
        for (size_t i = 0; i < truth_.data.size(); ++i)
            if (counts[i / 3]) squares += std::pow(double(other.data[i] - truth_.data[i]), 2), ++count;
    }
    return 20 * std::log10(peak_ / std::sqrt(squares / count));
}

double AlignLimit::moved_db(const MotionPath& path, Where where) const {
    return psnr_db([&](size_t k) { return moved(others_[k], resized(path[k].flow, truth_.width, truth_.height)); },
                   where);
}

double AlignLimit::still_db(Where where) const {
    return psnr_db([&](size_t k) { return others_[k]; }, where);
}

}  // namespace ols
