// SPDX-License-Identifier: MIT
// The weights of Brox's energy, compiled once for each vector path; the pulls of hints and of a given flow.
#include "flow/brox_flow.hpp"

#include <algorithm>
#include <cmath>

#include "flow/flow_view.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flow/brox_flow.cpp"
// clang-format off
#include <hwy/foreach_target.h>
#include "flow/flow_relaxation_inl.hpp"
// clang-format on

#ifndef OLS_BROX_FLOW_ONCE
#define OLS_BROX_FLOW_ONCE
namespace ols {

constexpr float psi_epsilon = 1e-6f;  // of Psi(s2) = sqrt(s2 + epsilon)
// Of the smoothness at the first warp of a coarse level: with the sharp one an even flow is too stiff to move in few sweeps.
constexpr float blunt_epsilon = 1e-2f;
constexpr int least_coarsest_warps = 6;

// A wish that w be (u, v), by colours: weight * Psi(|w - (u, v)|^2).
struct FlowPull {
    CheckeredPlane weight, u, v;
    FlowPull(int width, int height) : weight(width, height), u(width, height), v(width, height) {}
};

// One constraint a pixel, ix u + iy v + c = 0, by colours.
struct FlowConstraint {
    CheckeredPlane ix, iy, c;
    FlowConstraint(int width, int height) : ix(width, height), iy(width, height), c(width, height) {}
};

struct BroxTerm {
    int image_width, height;
    FlowConstraint brightness, gradient_x, gradient_y;
    CheckeredPlane valid;
    float gradient = 0, smoothness = 0;
    float smoothness_epsilon = psi_epsilon;
    std::vector<FlowPull> pulls;

    BroxTerm(int w, int h)
        : image_width(w), height(h), brightness(w, h), gradient_x(w, h), gradient_y(w, h), valid(w, h) {}
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {

HWY_INLINE float psi_derivative(float squared, float epsilon = psi_epsilon) {  // Psi', of the square
    return 0.5f / std::sqrt(squared + epsilon);
}

struct BroxWeights {
    BroxTerm& term;
    CheckeredPlane diffusivity;  // Psi'(|grad u|^2 + |grad v|^2) of two rows: this one and the next

    explicit BroxWeights(BroxTerm& t) : term(t), diffusivity(t.image_width, 2) {}
    int width() const { return term.image_width; }

    // Central differences, one-sided at the image's edge, where one neighbour is the pixel itself.
    HWY_INLINE void diffuse_row(CheckeredPlane& u, CheckeredPlane& v, int y) {
        const int above = std::max(y - 1, 0), below = std::min(y + 1, term.height - 1), last = term.image_width - 1;
        for (int color = 0; color < 2; ++color) {
            const int p = first_x(color, y), n = u.half, other = 1 - color;
            const float *u_side = u.row(other, y) + p, *v_side = v.row(other, y) + p;
            const float *u_up = u.row(above == y ? color : other, above),
                        *u_down = u.row(below == y ? color : other, below);
            const float *v_up = v.row(above == y ? color : other, above),
                        *v_down = v.row(below == y ? color : other, below);
            float* const out = diffusivity.row(color, y & 1);
            const float epsilon = term.smoothness_epsilon;
            OLS_INDEPENDENT
            for (int i = 0; i < n; ++i) {
                const float ux = u_side[i] - u_side[i - 1], vx = v_side[i] - v_side[i - 1];
                const float uy = u_down[i] - u_up[i], vy = v_down[i] - v_up[i];
                out[i] = psi_derivative(0.25f * (ux * ux + vx * vx + uy * uy + vy * vy), epsilon);
            }
        }
        // The first and last pixel of a row have no neighbour on one side: theirs is the next pixel's.
        if (last == 0) return;
        const auto at = [&](int x) { return diffusivity.row((x + y) & 1, y & 1) + (x >> 1); };
        *at(0) = *at(1);
        *at(last) = *at(last - 1);
    }

    // The diffusivity of an edge is the mean of its two pixels'.
    HWY_INLINE void weigh_edges(RelaxationRows& rows, int color, int y) {
        const int p = first_x(color, y), n = rows.half();
        const float half = 0.5f * term.smoothness;
        const float *here = diffusivity.row(color, y & 1), *side = diffusivity.row(1 - color, y & 1) + p,
                    *below = diffusivity.row(1 - color, (y + 1) & 1);
        float* const right = rows.row(RelaxationRows::right, color, y);
        float* const down = rows.row(RelaxationRows::down, color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            right[i] = half * (here[i] + side[i]);
            down[i] = half * (here[i] + below[i]);
        }
    }

    HWY_INLINE void weigh_data(RelaxationRows& rows, CheckeredPlane& u_plane, CheckeredPlane& v_plane, int color,
                               int y) {
        const int n = rows.half();
        const float share = term.gradient;
        const float *u = u_plane.row(color, y), *v = v_plane.row(color, y), *valid = term.valid.row(color, y);
        const float *ix = term.brightness.ix.row(color, y), *iy = term.brightness.iy.row(color, y),
                    *c = term.brightness.c.row(color, y);
        const float *ixx = term.gradient_x.ix.row(color, y), *ixy = term.gradient_x.iy.row(color, y),
                    *cx = term.gradient_x.c.row(color, y);
        const float *iyy = term.gradient_y.iy.row(color, y), *cy = term.gradient_y.c.row(color, y);
        float *a11 = rows.row(RelaxationRows::a11, color, y), *a12 = rows.row(RelaxationRows::a12, color, y),
              *a22 = rows.row(RelaxationRows::a22, color, y);
        float *b1 = rows.row(RelaxationRows::b1, color, y), *b2 = rows.row(RelaxationRows::b2, color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float r = ix[i] * u[i] + iy[i] * v[i] + c[i], rx = ixx[i] * u[i] + ixy[i] * v[i] + cx[i],
                        ry = ixy[i] * u[i] + iyy[i] * v[i] + cy[i];
            const float weight = valid[i] * psi_derivative(r * r + share * (rx * rx + ry * ry));
            a11[i] = weight * (ix[i] * ix[i] + share * (ixx[i] * ixx[i] + ixy[i] * ixy[i]));
            a12[i] = weight * (ix[i] * iy[i] + share * (ixx[i] * ixy[i] + ixy[i] * iyy[i]));
            a22[i] = weight * (iy[i] * iy[i] + share * (ixy[i] * ixy[i] + iyy[i] * iyy[i]));
            b1[i] = -weight * (ix[i] * c[i] + share * (ixx[i] * cx[i] + ixy[i] * cy[i]));
            b2[i] = -weight * (iy[i] * c[i] + share * (ixy[i] * cx[i] + iyy[i] * cy[i]));
        }
    }

    HWY_INLINE void add_pull(RelaxationRows& rows, CheckeredPlane& u_plane, CheckeredPlane& v_plane, FlowPull& pull,
                             int color, int y) {
        const int n = rows.half();
        const float *u = u_plane.row(color, y), *v = v_plane.row(color, y);
        const float *weight = pull.weight.row(color, y), *to_u = pull.u.row(color, y), *to_v = pull.v.row(color, y);
        float *a11 = rows.row(RelaxationRows::a11, color, y), *a22 = rows.row(RelaxationRows::a22, color, y);
        float *b1 = rows.row(RelaxationRows::b1, color, y), *b2 = rows.row(RelaxationRows::b2, color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float du = u[i] - to_u[i], dv = v[i] - to_v[i];
            const float w = weight[i] * psi_derivative(du * du + dv * dv);
            a11[i] += w;
            a22[i] += w;
            b1[i] += w * to_u[i];
            b2[i] += w * to_v[i];
        }
    }

    HWY_INLINE void weigh_row(RelaxationRows& rows, CheckeredPlane& u, CheckeredPlane& v, int y) {
        const bool last = y == term.height - 1;
        if (y == 0) diffuse_row(u, v, 0);
        if (!last) diffuse_row(u, v, y + 1);
        for (int color = 0; color < 2; ++color) {
            weigh_edges(rows, color, y);
            weigh_data(rows, u, v, color, y);
            for (FlowPull& pull : term.pulls) add_pull(rows, u, v, pull, color, y);
        }
        close_edges(rows, term.image_width, y, last);
    }
};

void relax_brox(BroxTerm& term, CheckeredPlane& u, CheckeredPlane& v, int sweeps, float relaxation) {
    BroxWeights weights(term);
    relax(weights, u, v, sweeps, relaxation);
}

// Row y of a constraint, ix (u - u0) + iy (v - v0) + difference = ix u + iy v + c: the derivatives of `slopes`.
HWY_INLINE void constrain_row(const PaddedPlane& slopes, const PaddedPlane& difference, const FlowField& flow, int y,
                              FlowConstraint& out) {
    for (int color = 0; color < 2; ++color) {
        const int p = first_x(color, y), n = (flow.width - p + 1) / 2, stride = slopes.stride;
        const float *slope = slopes.row(y) + p, *d = difference.row(y) + p;
        const ptrdiff_t first = ptrdiff_t(y) * flow.width + p;
        const float *u = flow.u.data() + first, *v = flow.v.data() + first;
        float *ix = out.ix.row(color, y), *iy = out.iy.row(color, y), *c = out.c.row(color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float gx = derivative(slope + 2 * i, 1), gy = derivative(slope + 2 * i, stride);
            ix[i] = gx;
            iy[i] = gy;
            c[i] = d[2 * i] - (gx * u[2 * i] + gy * v[2 * i]);
        }
    }
}

void constrain(const PaddedPlane& slopes, const PaddedPlane& difference, const FlowField& flow, FlowConstraint& out) {
    for (int y = 0; y < flow.height; ++y) constrain_row(slopes, difference, flow, y, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(relax_brox);
HWY_EXPORT(constrain);

namespace {

// The planes that the warps of a level share.
struct Level {
    FlowViewer viewer;
    PaddedPlane mean_x, mean_y, difference_x, difference_y;
    BroxTerm term;
    CheckeredPlane u, v;

    Level(const FlowPair& pair, int w, int h)
        : viewer(pair),
          mean_x(w, h),
          mean_y(w, h),
          difference_x(w, h),
          difference_y(w, h),
          term(w, h),
          u(w, h),
          v(w, h) {}
};

// Constant brightness, and constant gradient: the derivatives of the difference are zero, too.
void linearize(Level& level, const FlowField& flow) {
    const FlowView& view = level.viewer.through(flow);
    derivative_x(view.mean, level.mean_x);
    derivative_y(view.mean, level.mean_y);
    derivative_x(view.difference, level.difference_x);
    derivative_y(view.difference, level.difference_y);
    HWY_DYNAMIC_DISPATCH(constrain)(view.mean, view.difference, flow, level.term.brightness);
    HWY_DYNAMIC_DISPATCH(constrain)(level.mean_x, level.difference_x, flow, level.term.gradient_x);
    HWY_DYNAMIC_DISPATCH(constrain)(level.mean_y, level.difference_y, flow, level.term.gradient_y);
    split(view.valid, level.term.valid);
}

// All hints as one pull: at each pixel their weights phi add up, and their weighted mean is where they pull to.
FlowPull pull_of_hints(const BroxFlowOptions& options, int width, int height, double scale) {
    FlowPull pull(width, height);
    const double inverse = 1 / (2.0 * options.hint_radius * options.hint_radius);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            double sum = 0, u = 0, v = 0;
            for (const FlowHint& hint : options.hints) {
                const double dx = (x + 0.5) / scale - 0.5 - hint.x, dy = (y + 0.5) / scale - 0.5 - hint.y;
                const double phi = std::exp(-(dx * dx + dy * dy) * inverse);
                sum += phi, u += phi * hint.u, v += phi * hint.v;
            }
            if (sum < 1e-12) continue;
            const int color = (x + y) & 1;
            pull.weight.row(color, y)[x >> 1] = float(options.hint * sum);
            pull.u.row(color, y)[x >> 1] = float(u / sum * scale);
            pull.v.row(color, y)[x >> 1] = float(v / sum * scale);
        }
    return pull;
}

// A given flow, trusted as far as what it leads to looks the same.
FlowPull pull_of_flow(const BroxFlowOptions& options, FlowViewer& viewer, const FlowField& given) {
    FlowPull pull(given.width, given.height);
    const FlowView& view = viewer.through(given);
    std::vector<float> weight(given.size());
    for (int y = 0; y < given.height; ++y)
        for (int x = 0; x < given.width; ++x) {
            const float error = std::abs(view.difference.row(y)[x]);
            weight[size_t(y) * size_t(given.width) + size_t(x)] =
                options.keep * view.valid.row(y)[x] * std::max(0.0f, 1 - error / options.keep_threshold);
        }
    split(weight.data(), given.width, pull.weight);
    split(given.u.data(), given.width, pull.u);
    split(given.v.data(), given.width, pull.v);
    return pull;
}

FlowField solve_level(const FlowPair& pair, const FlowField& begin, const BroxFlowOptions& options,
                      const FlowField* initial, double scale, bool finest, int warps) {
    constexpr float relaxation = 1.9f;
    const int width = begin.width, height = begin.height;
    Level level(pair, width, height);
    level.term.gradient = options.gradient;
    level.term.smoothness = options.smoothness;
    if (!options.hints.empty()) level.term.pulls.push_back(pull_of_hints(options, width, height, scale));
    if (initial && options.keep > 0)
        level.term.pulls.push_back(pull_of_flow(options, level.viewer, resized(*initial, width, height)));
    FlowField flow = begin;
    for (int warp = 0; warp < warps; ++warp) {
        linearize(level, flow);
        level.term.smoothness_epsilon = warp == 0 && !finest ? blunt_epsilon : psi_epsilon;
        split(flow.u.data(), width, level.u);
        split(flow.v.data(), width, level.v);
        for (int n = 0; n < options.reweightings; ++n)
            HWY_DYNAMIC_DISPATCH(relax_brox)(level.term, level.u, level.v, options.sweeps, relaxation);
        join(level.u, width, flow.u.data());
        join(level.v, width, flow.v.data());
    }
    return flow;
}

}  // namespace

FlowField brox_flow(const FlowPair& pair, const BroxFlowOptions& options, const FlowField* initial) {
    FlowLevels which{.ratio = options.ratio, .coarsest = options.coarsest, .finest = options.finest_level};
    if (initial) which.octaves = options.initial_octaves;
    const FlowPyramid pyramid = flow_pyramid(pair, which, options.detail);
    return coarse_to_fine(pyramid, initial, [&](size_t level, const FlowField& begin) {
        const bool coarsest = !initial && level + 1 == pyramid.levels.size();
        const int warps = level == 0 ? options.finest_warps
                          : coarsest ? std::max(options.warps, least_coarsest_warps)
                                     : options.warps;
        const double scale = double(begin.width) / pair.from.width;
        return solve_level(pyramid.levels[level], begin, options, initial, scale, level == 0, warps);
    });
}

}  // namespace ols
#endif
