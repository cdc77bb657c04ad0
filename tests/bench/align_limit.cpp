// SPDX-License-Identifier: MIT
// Pictures of single moments, moved onto another one.
#include "align_limit.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "align_score.hpp"
#include "render/renderer.hpp"

namespace ols {

namespace {

Image led(const Image& image, const FlowField& flow) {
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

AlignLimit::AlignLimit(const Recording& recording, const MotionPath& true_path)
    : cycle_ticks_(double(recording.sequence.cycle_ticks())) {
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
        if (knot.is_instant) continue;
        Moment moment{knot.tick - at_tick, {}, {knot.confidence.begin(), knot.confidence.end()}, {}};
        moment.image = renderer.light(weights, at_us + moment.tick / double(tick_hz) * 1e6);
        moment.inside = eroded(moment.visible, truth_.width, truth_.height);
        moments_.push_back(std::move(moment));
    }
    peak_ = percentile(truth_.data, 0.999);
}

template <typename Moved>
double AlignLimit::psnr_db(const Moved& moved_to, Where where) const {
    double squares = 0, count = 0;
    for (const Moment& moment : moments_) {
        if (std::abs(moment.tick) > cycle_ticks_ / 2 + 1) continue;
        const std::vector<unsigned char>& counts = where == Where::inside ? moment.inside : moment.visible;
        const Image other = moved_to(moment);
        for (size_t i = 0; i < truth_.data.size(); ++i)
            if (counts[i / 3]) squares += std::pow(double(other.data[i] - truth_.data[i]), 2), ++count;
    }
    return 20 * std::log10(peak_ / std::sqrt(squares / count));
}

Image AlignLimit::moved(const Moment& moment, const MotionPath& path) const {
    const auto instant = std::ranges::find_if(path, &MotionKnot::is_instant);
    return led(moment.image, resized(flow_at(path, instant->tick + moment.tick), truth_.width, truth_.height));
}

const AlignLimit::Moment* AlignLimit::across(const Moment& moment) const {
    const double tick = moment.tick - std::copysign(cycle_ticks_, moment.tick);
    const auto found = std::ranges::find_if(moments_, [&](const Moment& one) { return std::abs(one.tick - tick) < 1; });
    return found == moments_.end() ? nullptr : &*found;
}

double AlignLimit::moved_db(const MotionPath& path, Where where, bool interpolates) const {
    const auto blended = [&](const Moment& moment) {
        Image nearer = moved(moment, path);
        const Moment* const other = interpolates ? across(moment) : nullptr;
        if (!other) return nearer;
        const Image far = moved(*other, path);
        const auto share = float(std::abs(moment.tick) / cycle_ticks_);  // of the far one
        for (size_t i = 0; i < far.data.size(); ++i)
            if (other->visible[i / 3]) nearer.data[i] += share * (far.data[i] - nearer.data[i]);
        return nearer;
    };
    return psnr_db(blended, where);
}

double AlignLimit::still_db(Where where) const {
    return psnr_db([](const Moment& moment) { return moment.image; }, where);
}

}  // namespace ols
