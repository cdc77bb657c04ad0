// SPDX-License-Identifier: MIT
// Warping, differences, derivatives and changes of layout, compiled once for each vector path. Loops are plain and
// independent, so that the compiler vectorises them without changing a bit of the result.
#include "flow/flow_view.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flow/flow_view.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Where a row's pixels are read, and with which weights; buffers of one row.
struct WarpRow {
    std::vector<int> at;
    std::vector<float> wx, wy;   // four planes of a row's width each
    std::vector<float> columns;  // four a pixel: the columns of its 4 x 4 neighbourhood, summed by wy

    explicit WarpRow(int width) : at(width), wx(4 * size_t(width)), wy(4 * size_t(width)), columns(4 * size_t(width)) {}
};

HWY_INLINE void cubic_weights(float t, float* HWY_RESTRICT w, int stride) {
    const float t2 = t * t, t3 = t2 * t;
    w[0] = -0.5f * t3 + t2 - 0.5f * t;
    w[stride] = 1.5f * t3 - 2.5f * t2 + 1;
    w[2 * stride] = -1.5f * t3 + 2 * t2 + 0.5f * t;
    w[3 * stride] = 0.5f * t3 - 0.5f * t2;
}

HWY_INLINE void place_row(const PaddedPlane& image, const float* HWY_RESTRICT u, const float* HWY_RESTRICT v, int y,
                          WarpRow& row, float* HWY_RESTRICT inside) {
    const int width = image.width, most_x = std::max(width - 2, 0), most_y = std::max(image.height - 2, 0);
    const float last_x = float(width - 1), last_y = float(image.height - 1);
    int* HWY_RESTRICT at = row.at.data();
    float* HWY_RESTRICT wx = row.wx.data();
    float* HWY_RESTRICT wy = row.wy.data();
    OLS_INDEPENDENT
    for (int x = 0; x < width; ++x) {
        const float fx = float(x) + u[x], fy = float(y) + v[x];
        const float hx = std::min(std::max(fx, 0.0f), last_x), hy = std::min(std::max(fy, 0.0f), last_y);
        const int ix = std::min(int(hx), most_x), iy = std::min(int(hy), most_y);
        inside[x] = hx == fx && hy == fy ? 1.0f : 0.0f;
        at[x] = (iy - 1) * image.stride + ix - 1;
        cubic_weights(hx - float(ix), wx + x, width);
        cubic_weights(hy - float(iy), wy + x, width);
    }
}

HWY_INLINE void warp_row(const PaddedPlane& image, WarpRow& row, float* HWY_RESTRICT out) {
    const int width = image.width, stride = image.stride;
    const float *origin = image.row(0), *wx = row.wx.data(), *wy = row.wy.data();
    float* HWY_RESTRICT columns = row.columns.data();
    const hn::CappedTag<float, 4> d;
    for (int x = 0; x < width; ++x) {
        const float* const from = origin + row.at[size_t(x)];
        const auto w0 = hn::Set(d, wy[x]), w1 = hn::Set(d, wy[width + x]), w2 = hn::Set(d, wy[2 * width + x]),
                   w3 = hn::Set(d, wy[3 * width + x]);
        for (size_t k = 0; k < 4; k += hn::Lanes(d)) {
            const auto upper =
                hn::Add(hn::Mul(w0, hn::LoadU(d, from + k)), hn::Mul(w1, hn::LoadU(d, from + stride + k)));
            const auto lower = hn::Add(hn::Mul(w2, hn::LoadU(d, from + 2 * stride + k)),
                                       hn::Mul(w3, hn::LoadU(d, from + 3 * stride + k)));
            hn::StoreU(hn::Add(upper, lower), d, columns + 4 * x + k);
        }
    }
    OLS_INDEPENDENT
    for (int x = 0; x < width; ++x)
        out[x] = wx[x] * columns[4 * x] + wx[width + x] * columns[4 * x + 1] + wx[2 * width + x] * columns[4 * x + 2] +
                 wx[3 * width + x] * columns[4 * x + 3];
}

void warp(const PaddedPlane& image, const FlowField& flow, PaddedPlane& out, PaddedPlane& inside) {
    WarpRow row(image.width);
    for (int y = 0; y < image.height; ++y) {
        const ptrdiff_t first = ptrdiff_t(y) * image.width;
        place_row(image, flow.u.data() + first, flow.v.data() + first, y, row, inside.row(y));
        warp_row(image, row, out.row(y));
    }
}

// The gain that gives the warped image, in `view.mean`, the energy of `from`, over what both show alike: pixels that differ by
// more than a standard deviation do not count. Sums of a fixed number of lanes: the same bits on every path.
float gain(const PaddedPlane& from, const FlowView& view) {
    constexpr int lanes = 16;
    float from_sums[lanes] = {}, moved_sums[lanes] = {};
    double from_energy = 0, moved_energy = 0;
    for (int y = 0; y < from.height; ++y) {
        const float* HWY_RESTRICT a = from.row(y);
        const float* HWY_RESTRICT b = view.mean.row(y);
        const float* HWY_RESTRICT valid = view.valid.row(y);
        for (int x = 0; x + lanes <= from.width; x += lanes)
            for (int i = 0; i < lanes; ++i) {
                const float d = a[x + i] - b[x + i], counts = d * d < 1 ? valid[x + i] : 0.0f;
                from_sums[i] += counts * a[x + i] * a[x + i];
                moved_sums[i] += counts * b[x + i] * b[x + i];
            }
        for (int i = 0; i < lanes; ++i) {
            from_energy += double(from_sums[i]), moved_energy += double(moved_sums[i]);
            from_sums[i] = moved_sums[i] = 0;
        }
    }
    if (from_energy == 0 || moved_energy == 0) return 1;
    return std::clamp(float(std::sqrt(from_energy / moved_energy)), 0.5f, 2.0f);
}

// `view.mean` holds the warped image.
void compare(const PaddedPlane& from, FlowView& view) {
    const float scale = gain(from, view);
    for (int y = 0; y < from.height; ++y) {
        const float* HWY_RESTRICT a = from.row(y);
        float* HWY_RESTRICT mean = view.mean.row(y);
        float* HWY_RESTRICT difference = view.difference.row(y);
        OLS_INDEPENDENT
        for (int x = 0; x < from.width; ++x) {
            const float b = scale * mean[x];
            difference[x] = b - a[x];
            mean[x] = 0.5f * (a[x] + b);
        }
    }
}

void derive(const PaddedPlane& plane, ptrdiff_t step, PaddedPlane& out) {
    for (int y = 0; y < plane.height; ++y) {
        const float* const r = plane.row(y);
        float* HWY_RESTRICT d = out.row(y);
        OLS_INDEPENDENT
        for (int x = 0; x < plane.width; ++x) d[x] = derivative(r + x, step);
    }
}

void split_row(const float* HWY_RESTRICT natural, int width, int y, CheckeredPlane& out) {
    for (int color = 0; color < 2; ++color) {
        const int p = first_x(color, y), n = (width - p + 1) / 2;
        float* HWY_RESTRICT to = out.row(color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) to[i] = natural[2 * i + p];
    }
}

void join_row(CheckeredPlane& plane, int width, int y, float* HWY_RESTRICT natural) {
    for (int color = 0; color < 2; ++color) {
        const int p = first_x(color, y), n = (width - p + 1) / 2;
        const float* HWY_RESTRICT from = plane.row(color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) natural[2 * i + p] = from[i];
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(warp);
HWY_EXPORT(compare);
HWY_EXPORT(derive);
HWY_EXPORT(split_row);
HWY_EXPORT(join_row);

namespace {

void hold_borders(PaddedPlane& plane) {
    for (int y = 0; y < plane.height; ++y) plane.hold_sides(y);
    plane.hold_ends();
}

// Times the share of both images that is seen; cubic convolution overshoots at a mask's edge.
void limit(const Image& from_seen, const PaddedPlane& to_seen, PaddedPlane& valid) {
    for (int y = 0; y < valid.height; ++y)
        for (int x = 0; x < valid.width; ++x)
            valid.row(y)[x] *= from_seen.at(x, y) * std::clamp(to_seen.row(y)[x], 0.0f, 1.0f);
}

}  // namespace

PaddedPlane padded(const Image& image) {
    assert(image.channels == 1);
    PaddedPlane out(image.width, image.height);
    for (int y = 0; y < image.height; ++y)
        std::copy_n(image.data.begin() + ptrdiff_t(y) * image.width, image.width, out.row(y));
    hold_borders(out);
    return out;
}

FlowViewer::FlowViewer(const FlowPair& pair)
    : from_(padded(pair.from)),
      to_(padded(pair.to)),
      from_seen_(pair.from_seen),
      view_(pair.from.width, pair.from.height) {
    if (!pair.to_seen.data.empty()) to_seen_ = padded(pair.to_seen);
}

const FlowView& FlowViewer::through(const FlowField& flow) {
    if (to_seen_.data.empty()) {
        HWY_DYNAMIC_DISPATCH(warp)(to_, flow, view_.mean, view_.valid);
    } else {
        PaddedPlane inside(flow.width, flow.height), seen(flow.width, flow.height);
        HWY_DYNAMIC_DISPATCH(warp)(to_seen_, flow, seen, inside);
        HWY_DYNAMIC_DISPATCH(warp)(to_, flow, view_.mean, view_.valid);
        limit(from_seen_, seen, view_.valid);
    }
    HWY_DYNAMIC_DISPATCH(compare)(from_, view_);
    hold_borders(view_.mean);
    hold_borders(view_.difference);
    return view_;
}

void derivative_x(const PaddedPlane& plane, PaddedPlane& out) {
    HWY_DYNAMIC_DISPATCH(derive)(plane, 1, out);
    hold_borders(out);
}

void derivative_y(const PaddedPlane& plane, PaddedPlane& out) {
    HWY_DYNAMIC_DISPATCH(derive)(plane, plane.stride, out);
    hold_borders(out);
}

void split(const float* rows, int width, CheckeredPlane& out) {
    for (int y = 0; y < out.rows; ++y) HWY_DYNAMIC_DISPATCH(split_row)(rows + ptrdiff_t(y) * width, width, y, out);
}

void split(const PaddedPlane& plane, CheckeredPlane& out) {
    for (int y = 0; y < out.rows; ++y) HWY_DYNAMIC_DISPATCH(split_row)(plane.row(y), plane.width, y, out);
}

void join(CheckeredPlane& plane, int width, float* rows) {
    for (int y = 0; y < plane.rows; ++y) HWY_DYNAMIC_DISPATCH(join_row)(plane, width, y, rows + ptrdiff_t(y) * width);
}

}  // namespace ols
#endif
