// SPDX-License-Identifier: MIT
// Relighting by weights of directions, and comparing.
#include "align_score.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "render/true_flow.hpp"

namespace ols {

namespace {

double cosine_to(Vec3 direction, Vec3 light) {
    return std::max(0.0, dot(normalized(direction), normalized(light)));
}

template <typename Images>
std::vector<const float*> pointers(const Images& images) {
    std::vector<const float*> out;
    for (const auto& image : images) out.push_back(image.data());
    return out;
}

// Gives pixels without a flow that of the nearest pixel that has one.
void extend(FlowField& flow) {
    cv::Mat unknown(flow.height, flow.width, CV_8U), distance, labels;
    for (size_t p = 0; p < flow.size(); ++p) unknown.data[p] = std::isfinite(flow.u[p]) ? 0 : 1;
    if (cv::countNonZero(unknown) == int(flow.size())) {
        flow = FlowField(flow.width, flow.height);
        return;
    }
    cv::distanceTransform(unknown, distance, labels, cv::DIST_L2, 5, cv::DIST_LABEL_PIXEL);
    std::vector<size_t> pixel_of_label(flow.size() + 1);
    for (size_t p = 0; p < flow.size(); ++p)
        if (!unknown.data[p]) pixel_of_label[size_t(labels.at<int>(int(p)))] = p;
    const FlowField known = flow;
    for (size_t p = 0; p < flow.size(); ++p) {
        const size_t nearest = pixel_of_label[size_t(labels.at<int>(int(p)))];
        flow.u[p] = known.u[nearest], flow.v[p] = known.v[nearest];
    }
}

}  // namespace

double percentile(std::vector<float> values, double share) {
    if (values.empty()) return 0;
    const auto at = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return double(*at);
}

const std::vector<Lighting>& lightings() {
    static const std::vector<Lighting> all = {
        {"key",
         [](Vec3 d) {
             return cosine_to(d, {-0.6, 0.5, 0.65}) > 0.93 ? 1.0 : 0.0;
         }},
        {"environment",
         [](Vec3 d) {
             return 0.2 + 0.8 * std::pow(cosine_to(d, {0.5, 0.8, 0.4}), 2) + 0.4 * cosine_to(d, {-0.8, 0, 0.6});
         }},
        {"side", [](Vec3 d) {
             return std::pow(cosine_to(d, {0.95, 0.15, 0.1}), 6);
         }}};
    return all;
}

TrueTarget::TrueTarget(const Recording& recording, const std::vector<std::vector<float>>& lamps)
    : width_(recording.camera().width),
      height_(recording.camera().height),
      lights_(image_lights(recording.sequence.basis, recording.stage.lamps)) {
    std::vector<float> peaks;
    for (const std::vector<int>& of_image : recording.sequence.basis.image_lamps) {
        std::vector<float>& image = images_.emplace_back(lamps[0].size());
        for (const int lamp : of_image)
            for (size_t p = 0; p < image.size(); ++p) image[p] += lamps[size_t(lamp)][p] / float(of_image.size());
        peaks.push_back(float(percentile(image, 0.999)));
    }
    image_peak_ = double(std::ranges::max(peaks));
    const Image everything = mixed(pointers(images_), std::vector<double>(images_.size(), 1.0));
    const double bright = percentile(everything.data, 0.999);
    for (const float v : everything.data) subject_.push_back(v > 0.02 * bright);
    for (const Lighting& lighting : lightings()) {
        truth_.push_back(mixed(pointers(images_), weights(lighting)));
        peaks_.push_back(percentile(truth_.back().data, 0.999));
    }
}

std::vector<double> TrueTarget::weights(const Lighting& lighting) const {
    std::vector<double> all;
    for (const LightPosition& light : lights_) all.push_back(lighting.weight(light.direction));
    return all;
}

Image TrueTarget::mixed(const std::vector<const float*>& images, const std::vector<double>& weights) const {
    Image sum(width_, height_, 1);
    for (size_t i = 0; i < images.size(); ++i)
        for (size_t p = 0; weights[i] != 0 && p < sum.data.size(); ++p) sum.data[p] += float(weights[i]) * images[i][p];
    return sum;
}

Image TrueTarget::relit(const Target& target, const Lighting& lighting) const {
    assert(target.planes() == 1 && target.lamps.size() == lights_.size());
    return mixed(pointers(target.lamps), weights(lighting));
}

double TrueTarget::relit_rms(const Target& target, size_t lighting, const std::vector<unsigned char>& among) const {
    const Image image = relit(target, lightings()[lighting]);
    double squares = 0, count = 0;
    for (size_t p = 0; p < among.size(); ++p)
        if (among[p]) squares += std::pow(double(image.data[p]) - double(truth_[lighting].data[p]), 2), ++count;
    return std::sqrt(squares / count);
}

double TrueTarget::psnr_db(const Target& target) const {
    double sum = 0;
    for (size_t l = 0; l < truth_.size(); ++l) sum += 20 * std::log10(peaks_[l] / relit_rms(target, l, subject_));
    return sum / double(truth_.size());
}

double TrueTarget::relit_percent(const Target& target, const std::vector<unsigned char>& among) const {
    double sum = 0;
    for (size_t l = 0; l < truth_.size(); ++l) sum += 100 * relit_rms(target, l, among) / peaks_[l];
    return sum / double(truth_.size());
}

double TrueTarget::images_percent(const Target& target, const std::vector<unsigned char>& among) const {
    assert(target.planes() == 1 && target.lamps.size() == images_.size());
    double squares = 0, count = 0;
    for (size_t i = 0; i < images_.size(); ++i)
        for (size_t p = 0; p < among.size(); ++p)
            if (among[p]) squares += std::pow(double(target.lamps[i][p]) - double(images_[i][p]), 2), ++count;
    return 100 * std::sqrt(squares / count) / image_peak_;
}

MotionPath true_path(const Recording& recording, size_t target) {
    const TargetFrames& frames = recording.targets[target];
    const double at_us = recording.target_us(target), at_tick = MotionDeveloper::instant_of(frames, recording.sequence);
    const auto [from, to] = MotionDeveloper::reach_of(frames, true);
    MotionPath path;
    for (const TargetFrames::Tracking& one : frames.tracking) {
        const double tick = middle_tick(*one.frame);
        // One tracking frame before the first slot and one after the last.
        while (path.size() == 1 && tick <= from) path.clear();
        if (!path.empty() && path.back().tick >= to) break;
        TrueFlow truth =
            true_flow(recording.scene, recording.camera(), at_us, at_us + (tick - at_tick) / double(tick_hz) * 1e6);
        MotionKnot knot{tick, std::move(truth.flow), {}, tick == at_tick};
        knot.confidence.assign(truth.visible.begin(), truth.visible.end());
        extend(knot.flow);
        if (knot.is_instant) {
            knot.flow = FlowField(knot.flow.width, knot.flow.height);
            knot.confidence.assign(knot.flow.size(), 1.0f);
        }
        path.push_back(std::move(knot));
    }
    return path;
}

Result<MotionPath> found_path(const Recording& recording, size_t target, const MotionQuality& quality) {
    DevelopOptions options;
    options.threads = 1;
    MotionDeveloper developer = developer_of(recording, quality, options);
    return developer.find_path(recording.targets[target]);
}

namespace {

// The knot half a cycle from the target, a tracking frame more at most: before it (side -1) or after it (side 1).
size_t half_a_cycle_from(const MotionPath& path, size_t instant, int side, double half_ticks) {
    size_t k = instant;
    const auto is_last = [&] { return side < 0 ? k == 0 : k + 1 == path.size(); };
    while (!is_last() && std::abs(path[k].tick - path[instant].tick) < half_ticks - 1) k = size_t(int(k) + side);
    return k;
}

size_t instant_of(const MotionPath& path) {
    return size_t(std::ranges::find_if(path, &MotionKnot::is_instant) - path.begin());
}

}  // namespace

FlowField flow_at(const MotionPath& path, double tick) {
    constexpr double rounding = 1;  // ticks
    const auto after = std::ranges::find_if(path, [&](const MotionKnot& knot) { return knot.tick > tick - rounding; });
    assert(after != path.end());
    if (std::abs(after->tick - tick) < rounding) return after->flow;
    assert(after != path.begin());
    const auto before = std::prev(after);
    const auto share = float((tick - before->tick) / (after->tick - before->tick));
    FlowField flow = before->flow;
    for (size_t p = 0; p < flow.size(); ++p) {
        flow.u[p] += share * (after->flow.u[p] - flow.u[p]);
        flow.v[p] += share * (after->flow.v[p] - flow.v[p]);
    }
    return flow;
}

PathError path_error(const MotionPath* found, const MotionPath& truth, Knots knots, double cycle_ticks,
                     const std::vector<unsigned char>& subject) {
    const size_t instant = instant_of(truth);
    std::vector<float> errors;
    for (const int side : {-1, 1}) {
        const size_t k = knots == Knots::nearest ? size_t(int(instant) + side)
                                                 : half_a_cycle_from(truth, instant, side, cycle_ticks / 2);
        const FlowField& exact = truth[k].flow;
        FlowField estimate(exact.width, exact.height);
        if (found) {
            estimate = resized(flow_at(*found, truth[k].tick), exact.width, exact.height);
        }
        for (size_t p = 0; p < exact.size(); ++p)
            if (subject[p] && truth[k].confidence[p] > 0)
                errors.push_back(std::hypot(estimate.u[p] - exact.u[p], estimate.v[p] - exact.v[p]));
    }
    double sum = 0;
    for (const float error : errors) sum += double(error);
    return {sum / double(errors.size()), percentile(std::move(errors), 0.95)};
}

CycleMotion cycle_motion(const MotionPath& truth, double cycle_ticks, const std::vector<unsigned char>& subject) {
    const size_t instant = instant_of(truth);
    const FlowField &first = truth[half_a_cycle_from(truth, instant, -1, cycle_ticks / 2)].flow,
                    &last = truth[half_a_cycle_from(truth, instant, 1, cycle_ticks / 2)].flow;
    CycleMotion motion;
    double sum = 0, count = 0;
    for (size_t p = 0; p < subject.size(); ++p) {
        if (!subject[p]) continue;
        const double px = std::hypot(double(last.u[p] - first.u[p]), double(last.v[p] - first.v[p]));
        motion.most_px = std::max(motion.most_px, px);
        sum += px, ++count;
    }
    motion.mean_px = sum / count;
    return motion;
}

std::vector<unsigned char> moving_pixels(const MotionPath& truth, const std::vector<unsigned char>& subject) {
    std::vector<unsigned char> moving(subject.size());
    for (const MotionKnot& knot : truth)
        for (size_t p = 0; p < subject.size(); ++p)
            if (subject[p] && (knot.confidence[p] == 0 || std::hypot(knot.flow.u[p], knot.flow.v[p]) > 0.25f))
                moving[p] = 1;
    return moving;
}

}  // namespace ols
