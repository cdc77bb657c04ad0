// SPDX-License-Identifier: MIT
// Pictures of single moments, moved onto another one.
#include "align_limit.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "align_score.hpp"
#include "renderer.hpp"

namespace ols {

namespace {

cv::Mat moved(const Image& image, const FlowField& flow) {
    const cv::Mat from(image.height, image.width, CV_32FC3, const_cast<float*>(image.data.data()));
    cv::Mat x(from.size(), CV_32F), y(from.size(), CV_32F), out;
    for (int p = 0; p < int(flow.size()); ++p) {
        x.at<float>(p / image.width, p % image.width) = float(p % image.width) + flow.u[size_t(p)];
        y.at<float>(p / image.width, p % image.width) = float(p / image.width) + flow.v[size_t(p)];
    }
    cv::remap(from, out, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    return out;
}

}  // namespace

AlignLimit align_limit(const Recording& recording, const MotionPath& path) {
    Renderer renderer({recording.scene, recording.stage, recording.camera(), false}, {});
    std::vector<Float3> weights(renderer.lamp_count());
    for (size_t lamp = 0; lamp < recording.stage.lamps.size(); ++lamp) {
        const auto w = float(lightings()[0].weight(recording.stage.lamps[lamp].direction));
        weights[lamp] = {w, w, w};
    }
    const double at_us = recording.target_us(0);
    const Image truth = renderer.light(weights, at_us);
    const double at_tick = MotionDeveloper::instant_of(recording.targets[0], recording.sequence);
    std::vector<float> values = truth.data;
    const auto bright = values.begin() + std::ptrdiff_t(0.999 * double(values.size() - 1));
    std::nth_element(values.begin(), bright, values.end());
    double still = 0, after = 0, count = 0;
    for (const MotionKnot& knot : path) {
        if (knot.is_instant) continue;
        const Image other = renderer.light(weights, at_us + (knot.tick - at_tick) / double(tick_hz) * 1e6);
        const cv::Mat aligned = moved(other, knot.flow);
        for (size_t i = 0; i < truth.data.size(); ++i) {
            if (knot.confidence[i / 3] == 0) continue;
            still += std::pow(double(other.data[i] - truth.data[i]), 2);
            after += std::pow(double(aligned.ptr<float>()[i] - truth.data[i]), 2);
            ++count;
        }
    }
    const auto psnr = [&](double squares) { return 20 * std::log10(double(*bright) / std::sqrt(squares / count)); };
    return {psnr(still), psnr(after)};
}

}  // namespace ols
