// SPDX-License-Identifier: MIT
// Robust optical flow after Black and Anandan, "A framework for the robust estimation of optical flow" (ICCV 1993) and
// "The robust estimation of multiple motions" (CVIU 1996): coarse to fine, with graduated non-convexity.
#pragma once

#include "flow/flow_pyramid.hpp"

namespace ols {

// The energy is, over all pixels, rho(Ix u + Iy v + It; data_sigma) + smoothness * sum over the four neighbours of
// rho(|w - w'|; flow_sigma), w = (u, v), with the Lorentzian rho(x; s) = log(1 + x^2 / (2 s^2)).
// Deviations from the papers: u and v share an edge's outlier process, as a motion boundary is one of both; a pixel's two
// components are solved for together, with weights psi(x) / x held for a few sweeps (iteratively reweighted least squares),
// where the papers take a step of each by a bound of its second derivative; the image is warped and linearised anew more than
// once a level; what is compared is the images' detail; the flow is median-filtered after each stage (Sun, Roth and Black 2010, "Secrets of optical flow").
struct RobustFlowOptions {
    FlowDetail detail = {.radius = 3};
    float smoothness = 1.0f;
    float data_sigma = 0.04f;  // of the detail's standard deviation
    float flow_sigma = 0.05f;  // pixels a pixel
    int stages = 2;        // of graduated non-convexity: sigmas begin 8 times larger, the last stage has those above
    int warps = 2;         // a stage: how often the image is warped by the flow so far and linearised anew
    int finest_warps = 2;  // at the finest level, which costs as much as all others together
    int reweightings = 2;  // a warp
    int sweeps = 6;        // of red-black over-relaxation, a reweighting
    int coarsest = 16;     // pixels: no pyramid level has a shorter side
    int finest_level = 0;  // 0: full resolution; 1: half, and the flow enlarged
    double initial_octaves = 1;  // by which the level where a given flow is taken up is coarser than the finest
};

// The flow between the two images of a pyramid, from zero or from `initial`. Deterministic: the same bits for any thread count
// and on every vector path.
FlowField robust_flow(const FlowPair& pair, const RobustFlowOptions& options, const FlowField* initial = nullptr);

}  // namespace ols
