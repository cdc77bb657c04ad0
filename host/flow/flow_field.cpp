// SPDX-License-Identifier: MIT
// Resizing of flow fields, and images seen through them.
#include "flow/flow_field.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace ols {

namespace {

// A coordinate's place among samples of one row or column, edges held; what is no number goes to the first.
struct Place {
    int at;
    float fraction;
};

Place place_of(float coordinate, int size) {
    const float held = coordinate > 0 ? std::min(coordinate, float(size - 1)) : 0.0f;
    const int at = std::min(int(held), std::max(size - 2, 0));
    return {at, held - float(at)};
}

// Keys' cubic convolution kernel, a = -1/2, for the samples at -1, 0, 1, 2 from a fraction t.
void cubic_weights(float t, float (&w)[4]) {
    const float t2 = t * t, t3 = t2 * t;
    w[0] = -0.5f * t3 + t2 - 0.5f * t;
    w[1] = 1.5f * t3 - 2.5f * t2 + 1;
    w[2] = -1.5f * t3 + 2 * t2 + 0.5f * t;
    w[3] = 0.5f * t3 - 0.5f * t2;
}

float cubic(const Image& image, float x, float y) {
    const Place px = place_of(x, image.width), py = place_of(y, image.height);
    float wx[4], wy[4];
    cubic_weights(px.fraction, wx);
    cubic_weights(py.fraction, wy);
    float sum = 0;
    for (int j = 0; j < 4; ++j) {
        const float* row = &image.data[size_t(std::clamp(py.at + j - 1, 0, image.height - 1)) * size_t(image.width)];
        float across = 0;
        for (int i = 0; i < 4; ++i) across += wx[i] * row[std::clamp(px.at + i - 1, 0, image.width - 1)];
        sum += wy[j] * across;
    }
    return sum;
}

}  // namespace

FlowField resized(const FlowField& flow, int width, int height) {
    FlowField out(width, height);
    const auto resize = [&](const std::vector<float>& from, std::vector<float>& to, double scale) {
        const cv::Mat source(flow.height, flow.width, CV_32F, const_cast<float*>(from.data()));
        cv::Mat target(height, width, CV_32F, to.data());
        cv::resize(source, target, target.size(), 0, 0, cv::INTER_LINEAR);
        if (scale != 1) target *= scale;
    };
    resize(flow.u, out.u, double(width) / flow.width);
    resize(flow.v, out.v, double(height) / flow.height);
    return out;
}

Image warped(const Image& image, const FlowField& flow, std::vector<unsigned char>* inside) {
    assert(image.channels == 1 && image.width == flow.width && image.height == flow.height);
    Image out(image.width, image.height, 1);
    if (inside) inside->assign(flow.size(), 1);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const size_t at = size_t(y) * size_t(image.width) + size_t(x);
            const float fx = float(x) + flow.u[at], fy = float(y) + flow.v[at];
            out.data[at] = cubic(image, fx, fy);
            const bool in = fx >= 0 && fy >= 0 && fx <= float(image.width - 1) && fy <= float(image.height - 1);
            if (inside && !in) (*inside)[at] = 0;
        }
    return out;
}

}  // namespace ols
