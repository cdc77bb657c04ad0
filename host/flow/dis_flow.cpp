// SPDX-License-Identifier: MIT
// Images to 8 bits, OpenCV's call, and the flow back to planes.
#include "flow/dis_flow.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "flow/brightness_range.hpp"

namespace ols {

namespace {

cv::Mat mat_of(const Image& image) {
    return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
}

// The range of both images' brightness, but for the thousandth at either end, onto 0 to 255.
void quantize(const Image& from_image, const Image& to_image, cv::Mat& from, cv::Mat& to) {
    std::vector<float> sample;
    sample.reserve(2 * from_image.data.size() / 7 + 2);
    for (const Image* image : {&from_image, &to_image})
        for (size_t p = 0; p < image->data.size(); p += 7) sample.push_back(image->data[p]);
    const BrightnessRange found = range_without(sample, sample.size() / 1000);
    const float range = found.high - found.low;
    const double scale = range > 0 ? 255 / double(range) : 0;
    mat_of(from_image).convertTo(from, CV_8U, scale, -found.low * scale);
    mat_of(to_image).convertTo(to, CV_8U, scale, -found.low * scale);
}

// OpenCV reads beside images that are only few patches wide: those get a border on the right and below.
cv::Mat enlarged(const cv::Mat& image, int smallest) {
    const int right = std::max(smallest - image.cols, 0), below = std::max(smallest - image.rows, 0);
    if (right + below == 0) return image;
    cv::Mat out;
    cv::copyMakeBorder(image, out, 0, below, 0, right, cv::BORDER_REPLICATE);
    return out;
}

// By patches, from coarse to fine.
FlowField searched(const cv::Mat& from_image, const cv::Mat& to_image, const DisFlowOptions& options,
                   const FlowField* initial) {
    const int width = from_image.cols, height = from_image.rows;
    const int smallest = 4 * options.patch_size << options.finest_scale;
    const cv::Ptr<cv::DISOpticalFlow> dis = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
    dis->setFinestScale(options.finest_scale);
    dis->setPatchSize(options.patch_size);
    dis->setPatchStride(options.patch_stride);
    dis->setGradientDescentIterations(options.iterations);
    dis->setVariationalRefinementIterations(options.refinements);
    dis->setVariationalRefinementAlpha(options.smoothness);
    dis->setVariationalRefinementDelta(options.brightness);
    dis->setVariationalRefinementGamma(options.gradient);
    cv::Mat vectors;
    if (initial) {
        const std::vector<cv::Mat> planes = {cv::Mat(height, width, CV_32F, const_cast<float*>(initial->u.data())),
                                             cv::Mat(height, width, CV_32F, const_cast<float*>(initial->v.data()))};
        cv::merge(planes, vectors);
        vectors = enlarged(vectors, smallest);
    }
    dis->calc(enlarged(from_image, smallest), enlarged(to_image, smallest), vectors);
    FlowField flow(width, height);
    std::vector<cv::Mat> planes = {cv::Mat(height, width, CV_32F, flow.u.data()),
                                   cv::Mat(height, width, CV_32F, flow.v.data())};
    cv::split(vectors(cv::Rect(0, 0, width, height)), planes);
    return flow;
}

// Brox 2004 without a pyramid: finds what is left of about a pixel.
void refine(const cv::Mat& from, const cv::Mat& to, const DisFlowOptions& options, FlowField& flow) {
    const cv::Ptr<cv::VariationalRefinement> refinement = cv::VariationalRefinement::create();
    refinement->setFixedPointIterations(options.final_refinements);
    refinement->setAlpha(options.smoothness);
    refinement->setDelta(options.brightness);
    refinement->setGamma(options.gradient);
    cv::Mat u(flow.height, flow.width, CV_32F, flow.u.data()), v(flow.height, flow.width, CV_32F, flow.v.data());
    refinement->calcUV(from, to, u, v);
}

// DIS knows no masks: what is not seen moves as the nearest pixel that is, smoothed, or every pixel of an outline would draw a
// border of its own through all that lies beyond it. What is twice as far from that pixel as it gets in `links` links as long as
// this one, half a cycle and more, stands still.
void follow_seen(const Image& seen, FlowField& flow) {
    constexpr double smoothing = 4;              // pixels
    constexpr float links = 6, least_reach = 2;  // pixels
    if (seen.data.empty()) return;
    cv::Mat unseen(seen.height, seen.width, CV_8U), distance, nearest;
    for (int y = 0; y < seen.height; ++y)
        for (int x = 0; x < seen.width; ++x) unseen.at<uint8_t>(y, x) = seen.at(x, y) == 0;
    cv::distanceTransform(unseen, distance, nearest, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
    std::vector<size_t> place(flow.size() + 1, flow.size());  // of the seen pixel of each label
    for (size_t p = 0; p < flow.size(); ++p)
        if (unseen.data[p] == 0) place[size_t(nearest.ptr<int>()[p])] = p;
    const auto smoothed = [&](const std::vector<float>& plane) {
        std::vector<float> filled = plane;
        for (size_t p = 0; p < flow.size(); ++p)
            if (const size_t from = place[size_t(nearest.ptr<int>()[p])]; from < flow.size()) filled[p] = plane[from];
        cv::Mat smooth;
        cv::GaussianBlur(cv::Mat(flow.height, flow.width, CV_32F, filled.data()), smooth, {0, 0}, smoothing, smoothing,
                         cv::BORDER_REPLICATE);
        return smooth;
    };
    const cv::Mat smooth_u = smoothed(flow.u), smooth_v = smoothed(flow.v);
    for (size_t p = 0; p < flow.size(); ++p) {
        if (unseen.data[p] == 0) continue;
        const float u = smooth_u.ptr<float>()[p], v = smooth_v.ptr<float>()[p];
        const float reach = links * std::hypot(u, v) + least_reach;
        const float share = std::clamp(2 - distance.ptr<float>()[p] / reach, 0.0f, 1.0f);
        flow.u[p] = share * u, flow.v[p] = share * v;
    }
}

}  // namespace

FlowField dis_flow(const Image& from_image, const Image& to_image, const Image& from_seen,
                   const DisFlowOptions& options, const FlowField* initial) {
    cv::Mat from, to;
    quantize(from_image, to_image, from, to);
    FlowField flow = options.search ? searched(from, to, options, initial)
                     : initial      ? *initial
                                    : FlowField(from.cols, from.rows);
    if (options.final_refinements > 0) refine(from, to, options, flow);
    follow_seen(from_seen, flow);
    return flow;
}

}  // namespace ols
