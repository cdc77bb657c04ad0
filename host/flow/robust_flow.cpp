// SPDX-License-Identifier: MIT
// The Lorentzian weights, compiled once for each vector path, and the stages and warps of a level.
#include "flow/robust_flow.hpp"

#include <cmath>

#include "flow/flow_pyramid.hpp"
#include "flow/flow_view.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flow/robust_flow.cpp"
// clang-format off
#include <hwy/foreach_target.h>
#include "flow/flow_relaxation_inl.hpp"
// clang-format on

#ifndef OLS_ROBUST_FLOW_ONCE
#define OLS_ROBUST_FLOW_ONCE
namespace ols {

// The data term of one warp, ix u + iy v + c, by colours, and the scales of the stage.
struct RobustTerm {
    int image_width;
    CheckeredPlane ix, iy, c, valid;
    float data_sigma = 0, flow_sigma = 0, smoothness = 0;

    RobustTerm(int width, int height)
        : image_width(width), ix(width, height), iy(width, height), c(width, height), valid(width, height) {}
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {

struct RobustWeights {
    RobustTerm& term;

    int width() const { return term.image_width; }

    // psi(x) / x of the Lorentzian is 2 / (2 sigma^2 + x^2).
    HWY_INLINE void weigh_edges(RelaxationRows& rows, CheckeredPlane& u_plane, CheckeredPlane& v_plane, int color,
                                int y) {
        const int p = first_x(color, y), n = rows.half(), below = std::min(y + 1, u_plane.rows - 1);
        const float widest = 2 * term.flow_sigma * term.flow_sigma, scale = 2 * term.smoothness;
        const float *u = u_plane.row(color, y), *u_side = u_plane.row(1 - color, y) + p,
                    *u_down = u_plane.row(1 - color, below);
        const float *v = v_plane.row(color, y), *v_side = v_plane.row(1 - color, y) + p,
                    *v_down = v_plane.row(1 - color, below);
        float* HWY_RESTRICT right = rows.row(RelaxationRows::right, color, y);
        float* HWY_RESTRICT down = rows.row(RelaxationRows::down, color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float du = u_side[i] - u[i], dv = v_side[i] - v[i], eu = u_down[i] - u[i], ev = v_down[i] - v[i];
            right[i] = scale / (widest + du * du + dv * dv);
            down[i] = scale / (widest + eu * eu + ev * ev);
        }
    }

    HWY_INLINE void weigh_data(RelaxationRows& rows, CheckeredPlane& u_plane, CheckeredPlane& v_plane, int color,
                               int y) {
        const int n = rows.half();
        const float widest = 2 * term.data_sigma * term.data_sigma;
        const float *u = u_plane.row(color, y), *v = v_plane.row(color, y), *ix = term.ix.row(color, y),
                    *iy = term.iy.row(color, y), *c = term.c.row(color, y), *valid = term.valid.row(color, y);
        float* HWY_RESTRICT a11 = rows.row(RelaxationRows::a11, color, y);
        float* HWY_RESTRICT a12 = rows.row(RelaxationRows::a12, color, y);
        float* HWY_RESTRICT a22 = rows.row(RelaxationRows::a22, color, y);
        float* HWY_RESTRICT b1 = rows.row(RelaxationRows::b1, color, y);
        float* HWY_RESTRICT b2 = rows.row(RelaxationRows::b2, color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float gx = ix[i], gy = iy[i], gc = c[i], r = gx * u[i] + gy * v[i] + gc;
            const float weight = 2 * valid[i] / (widest + r * r);
            a11[i] = weight * gx * gx;
            a12[i] = weight * gx * gy;
            a22[i] = weight * gy * gy;
            b1[i] = -weight * gx * gc;
            b2[i] = -weight * gy * gc;
        }
    }

    HWY_INLINE void weigh_row(RelaxationRows& rows, CheckeredPlane& u, CheckeredPlane& v, int y) {
        for (int color = 0; color < 2; ++color) {
            weigh_edges(rows, u, v, color, y);
            weigh_data(rows, u, v, color, y);
        }
        close_edges(rows, term.image_width, y, y == u.rows - 1);
    }
};

// Linearises row y of the difference about the flow so far: ix (u - u0) + iy (v - v0) + difference = ix u + iy v + c.
void linearize_row(const FlowView& view, const FlowField& flow, int y, RobustTerm& term) {
    const int stride = view.mean.stride;
    for (int color = 0; color < 2; ++color) {
        const int p = first_x(color, y), n = (flow.width - p + 1) / 2;
        const float *mean = view.mean.row(y) + p, *difference = view.difference.row(y) + p,
                    *valid = view.valid.row(y) + p;
        const ptrdiff_t first = ptrdiff_t(y) * flow.width + p;
        const float *u = flow.u.data() + first, *v = flow.v.data() + first;
        float *ix = term.ix.row(color, y), *iy = term.iy.row(color, y), *c = term.c.row(color, y);
        float* to_valid = term.valid.row(color, y);
        OLS_INDEPENDENT
        for (int i = 0; i < n; ++i) {
            const float gx = derivative(mean + 2 * i, 1), gy = derivative(mean + 2 * i, stride);
            ix[i] = gx;
            iy[i] = gy;
            c[i] = difference[2 * i] - (gx * u[2 * i] + gy * v[2 * i]);
            to_valid[i] = valid[2 * i];
        }
    }
}

void linearize(const FlowView& view, const FlowField& flow, RobustTerm& term) {
    for (int y = 0; y < flow.height; ++y) linearize_row(view, flow, y, term);
}

void relax_robust(RobustTerm& term, CheckeredPlane& u, CheckeredPlane& v, int sweeps, float relaxation) {
    RobustWeights weights{term};
    relax(weights, u, v, sweeps, relaxation);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(linearize);
HWY_EXPORT(relax_robust);

namespace {

// The planes that the warps of a level share.
struct Level {
    FlowViewer viewer;
    RobustTerm term;
    CheckeredPlane u, v;

    explicit Level(const FlowPair& pair)
        : viewer(pair),
          term(pair.from.width, pair.from.height),
          u(pair.from.width, pair.from.height),
          v(pair.from.width, pair.from.height) {}
};

void solve_warp(Level& level, const RobustFlowOptions& options, FlowField& flow) {
    constexpr float relaxation = 1.9f;
    HWY_DYNAMIC_DISPATCH(linearize)(level.viewer.through(flow), flow, level.term);
    split(flow.u.data(), flow.width, level.u);
    split(flow.v.data(), flow.width, level.v);
    for (int n = 0; n < options.reweightings; ++n)
        HWY_DYNAMIC_DISPATCH(relax_robust)(level.term, level.u, level.v, options.sweeps, relaxation);
    join(level.u, flow.width, flow.u.data());
    join(level.v, flow.width, flow.v.data());
}

FlowField solve_level(const FlowPair& pair, const FlowField& begin, const RobustFlowOptions& options, bool finest) {
    Level level(pair);
    FlowField flow = begin;
    level.term.smoothness = options.smoothness;
    for (int stage = 0; stage < options.stages; ++stage) {
        const float widening =
            options.stages == 1 ? 1.0f : std::pow(8.0f, float(options.stages - 1 - stage) / float(options.stages - 1));
        level.term.data_sigma = options.data_sigma * widening;
        level.term.flow_sigma = options.flow_sigma * widening;
        for (int warp = 0; warp < (finest ? options.finest_warps : options.warps); ++warp)
            solve_warp(level, options, flow);
        median_filter(flow);
    }
    return flow;
}

}  // namespace

FlowField robust_flow(const FlowPair& pair, const RobustFlowOptions& options, const FlowField* initial) {
    FlowLevels which{.ratio = 0.5, .coarsest = options.coarsest, .finest = options.finest_level};
    if (initial) which.octaves = options.initial_octaves;
    const FlowPyramid pyramid = flow_pyramid(pair, which, options.detail);
    return coarse_to_fine(pyramid, initial, [&](size_t level, const FlowField& begin) {
        return solve_level(pyramid.levels[level], begin, options, level == 0);
    });
}

}  // namespace ols
#endif
