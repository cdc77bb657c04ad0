// SPDX-License-Identifier: MIT
// The pyramid, the linearisation and the sweeps of the robust flow.
#include "reflectance/robust_flow.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace ols {

namespace {

// A plane with a border of one pixel, so that neighbours need no test. Row y begins at row(y).
struct Bordered {
    int stride = 0;
    std::vector<float> data;

    Bordered(int width, int height) : stride(width + 2), data(size_t(stride) * size_t(height + 2)) {}
    float* row(int y) { return data.data() + ptrdiff_t(stride) * (y + 1) + 1; }
};

// The system of one warp: data term r = ix u + iy v + c, and what a reweighting makes of it.
struct System {
    int width, height;
    Bordered u, v, ix, iy, c, valid;
    Bordered right, down;  // weights of the edges to the right and down; zero on the border
    Bordered step, share;  // wd / (wd |g|^2 + lambda * sum of edges); 1 / sum of edges

    System(int w, int h)
        : width(w),
          height(h),
          u(w, h),
          v(w, h),
          ix(w, h),
          iy(w, h),
          c(w, h),
          valid(w, h),
          right(w, h),
          down(w, h),
          step(w, h),
          share(w, h) {}
};

float lorentzian_weight(float squared, float sigma) {  // psi(x) / x
    return 2 / (2 * sigma * sigma + squared);
}

void weigh_edges(System& s, float sigma) {
    for (int y = 0; y < s.height; ++y) {
        const float *u = s.u.row(y), *v = s.v.row(y), *below_u = s.u.row(y + 1), *below_v = s.v.row(y + 1);
        float *right = s.right.row(y), *down = s.down.row(y);
        const float last = y + 1 < s.height ? 1.0f : 0.0f;
        for (int x = 0; x < s.width; ++x) {
            const float du = u[x + 1] - u[x], dv = v[x + 1] - v[x], eu = below_u[x] - u[x], ev = below_v[x] - v[x];
            right[x] = lorentzian_weight(du * du + dv * dv, sigma);
            down[x] = last * lorentzian_weight(eu * eu + ev * ev, sigma);
        }
        right[s.width - 1] = 0;
    }
}

void weigh_data(System& s, float sigma, float smoothness) {
    for (int y = 0; y < s.height; ++y) {
        const float *u = s.u.row(y), *v = s.v.row(y), *ix = s.ix.row(y), *iy = s.iy.row(y), *c = s.c.row(y),
                    *valid = s.valid.row(y), *right = s.right.row(y), *down = s.down.row(y), *up = s.down.row(y - 1);
        float *step = s.step.row(y), *share = s.share.row(y);
        for (int x = 0; x < s.width; ++x) {
            const float r = ix[x] * u[x] + iy[x] * v[x] + c[x];
            const float weight = valid[x] * lorentzian_weight(r * r, sigma);
            const float edges = right[x] + right[x - 1] + down[x] + up[x];
            share[x] = 1 / edges;
            step[x] = weight / (weight * (ix[x] * ix[x] + iy[x] * iy[x]) + smoothness * edges);
        }
    }
}

// Half a sweep: the pixels of one colour of the checkerboard, from their neighbours, which are of the other. A pixel's two
// equations, (lambda E + w g g') x = lambda E mean - w c g, give x = mean - step (g . mean + c) g (as Horn and Schunck 1981).
void sweep_color(System& s, int color, float relaxation) {
    for (int y = 0; y < s.height; ++y) {
        float *u = s.u.row(y), *v = s.v.row(y);
        const float *above_u = s.u.row(y - 1), *below_u = s.u.row(y + 1), *above_v = s.v.row(y - 1),
                    *below_v = s.v.row(y + 1), *right = s.right.row(y), *down = s.down.row(y), *up = s.down.row(y - 1),
                    *ix = s.ix.row(y), *iy = s.iy.row(y), *c = s.c.row(y), *step = s.step.row(y),
                    *share = s.share.row(y);
        for (int x = (y + color) & 1; x < s.width; x += 2) {
            const float mean_u =
                (right[x] * u[x + 1] + right[x - 1] * u[x - 1] + down[x] * below_u[x] + up[x] * above_u[x]) * share[x];
            const float mean_v =
                (right[x] * v[x + 1] + right[x - 1] * v[x - 1] + down[x] * below_v[x] + up[x] * above_v[x]) * share[x];
            const float t = step[x] * (ix[x] * mean_u + iy[x] * mean_v + c[x]);
            u[x] += relaxation * (mean_u - ix[x] * t - u[x]);
            v[x] += relaxation * (mean_v - iy[x] * t - v[x]);
        }
    }
}

cv::Mat mat_of(const Image& image) {
    return cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.data.data()));
}

void median_filter(System& s) {
    for (Bordered* plane : {&s.u, &s.v}) {
        const cv::Mat inner(s.height, s.width, CV_32F, plane->row(0), size_t(plane->stride) * sizeof(float));
        cv::Mat filtered;
        cv::medianBlur(inner, filtered, 5);
        for (int y = 0; y < s.height; ++y) std::copy_n(filtered.ptr<float>(y), s.width, plane->row(y));
    }
}

FlowField flow_of(System& s) {
    FlowField flow(s.width, s.height);
    for (int y = 0; y < s.height; ++y) {
        std::copy_n(s.u.row(y), s.width, flow.u.begin() + ptrdiff_t(y) * s.width);
        std::copy_n(s.v.row(y), s.width, flow.v.begin() + ptrdiff_t(y) * s.width);
    }
    return flow;
}

// Linearises the brightness difference about the flow so far; derivatives of the mean of both images, five points wide.
void linearize(System& s, const Image& from, const Image& to) {
    const FlowField flow = flow_of(s);
    std::vector<unsigned char> inside;
    const Image moved = warped(to, flow, &inside);
    Image mean(from.width, from.height, 1);
    for (size_t p = 0; p < mean.data.size(); ++p) mean.data[p] = (from.data[p] + moved.data[p]) / 2;
    const cv::Mat kernel = (cv::Mat_<float>(1, 5) << 1, -8, 0, 8, -1) / 12, one = cv::Mat::ones(1, 1, CV_32F);
    cv::Mat gx, gy;
    cv::sepFilter2D(mat_of(mean), gx, CV_32F, kernel, one, {-1, -1}, 0, cv::BORDER_REPLICATE);
    cv::sepFilter2D(mat_of(mean), gy, CV_32F, one, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
    for (int y = 0; y < s.height; ++y)
        for (int x = 0; x < s.width; ++x) {
            const size_t at = size_t(y) * size_t(s.width) + size_t(x);
            const float ix = gx.at<float>(y, x), iy = gy.at<float>(y, x);
            s.ix.row(y)[x] = ix;
            s.iy.row(y)[x] = iy;
            s.c.row(y)[x] = moved.data[at] - from.data[at] - ix * flow.u[at] - iy * flow.v[at];
            s.valid.row(y)[x] = inside[at];
        }
}

FlowField solve_level(const Image& from, const Image& to, const FlowField& begin, const RobustFlowOptions& options) {
    constexpr float relaxation = 1.9f;
    System s(from.width, from.height);
    for (int y = 0; y < s.height; ++y) {
        std::copy_n(begin.u.begin() + ptrdiff_t(y) * s.width, s.width, s.u.row(y));
        std::copy_n(begin.v.begin() + ptrdiff_t(y) * s.width, s.width, s.v.row(y));
    }
    for (int stage = 0; stage < options.stages; ++stage) {
        const float widening =
            options.stages == 1 ? 1.0f : std::pow(8.0f, float(options.stages - 1 - stage) / float(options.stages - 1));
        for (int warp = 0; warp < options.warps; ++warp) {
            linearize(s, from, to);
            for (int n = 0; n < options.reweightings; ++n) {
                weigh_edges(s, options.flow_sigma * widening);
                weigh_data(s, options.data_sigma * widening, options.smoothness);
                for (int k = 0; k < 2 * options.sweeps; ++k) sweep_color(s, k & 1, relaxation);
            }
            median_filter(s);
        }
    }
    return flow_of(s);
}

// Brightness of mean 0 and standard deviation 1; non-finite pixels become the mean.
Image normalized_brightness(const Image& image) {
    double sum = 0, squares = 0;
    size_t finite = 0;
    for (const float v : image.data)
        if (std::isfinite(v)) sum += v, squares += double(v) * v, finite++;
    const double mean = finite ? sum / double(finite) : 0;
    const double variance = finite ? squares / double(finite) - mean * mean : 0;
    const double scale = variance > 0 ? 1 / std::sqrt(variance) : 0;
    Image out = image;
    for (float& v : out.data) v = std::isfinite(v) ? float((v - mean) * scale) : 0.0f;
    return out;
}

Image halved(const Image& image) {
    cv::Mat blurred;
    cv::GaussianBlur(mat_of(image), blurred, {0, 0}, 0.9, 0.9, cv::BORDER_REPLICATE);
    Image out((image.width + 1) / 2, (image.height + 1) / 2, 1);
    cv::Mat half = mat_of(out);
    cv::resize(blurred, half, half.size(), 0, 0, cv::INTER_LINEAR);
    return out;
}

}  // namespace

FlowField robust_flow(const Image& from, const Image& to, const RobustFlowOptions& options, const FlowField* initial) {
    assert(from.channels == 1 && to.channels == 1 && from.width == to.width && from.height == to.height);
    std::vector<Image> a = {normalized_brightness(from)}, b = {normalized_brightness(to)};
    while (std::min(a.back().width, a.back().height) / 2 >= options.coarsest) {
        a.push_back(halved(a.back()));
        b.push_back(halved(b.back()));
    }
    size_t level = a.size() - 1;
    FlowField flow(a[level].width, a[level].height);
    if (initial) {
        level = std::min(level, size_t(options.finest_level) + 1);  // what is left to find is small
        flow = resized(*initial, a[level].width, a[level].height);
    }
    for (;; --level) {
        flow = resized(flow, a[level].width, a[level].height);
        flow = solve_level(a[level], b[level], flow, options);
        if (level == size_t(options.finest_level) || level == 0) break;
    }
    return resized(flow, from.width, from.height);
}

}  // namespace ols
