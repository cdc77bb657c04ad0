// SPDX-License-Identifier: MIT
// Robust optical flow after Black and Anandan, "A framework for the robust estimation of optical flow" (ICCV 1993) and
// "The robust estimation of multiple motions" (CVIU 1996): coarse to fine, with graduated non-convexity.
#pragma once

#include "reflectance/flow_field.hpp"

namespace ols {

// The energy is, over all pixels, rho(Ix u + Iy v + It; data_sigma) + smoothness * sum over the four neighbours of
// rho(u - u'; flow_sigma) + rho(v - v'; flow_sigma), with the Lorentzian rho(x; s) = log(1 + x^2 / (2 s^2)).
// Deviations from the papers: the two components of a pixel are solved for together, with weights psi(x) / x held for a few
// sweeps (iteratively reweighted least squares), where the papers take a step of each by a bound of its second derivative;
// the flow so far is median-filtered between warps (Sun, Roth and Black 2010, "Secrets of optical flow").
struct RobustFlowOptions {
    float smoothness = 1.0f;
    float data_sigma = 0.02f;  // of the brightness of `from`'s own spread (its standard deviation is 1)
    float flow_sigma = 0.05f;  // pixels a pixel
    int stages = 2;        // of graduated non-convexity: sigmas begin 8 times larger, the last stage has those above
    int warps = 2;         // a stage: how often the image is warped by the flow so far and linearised anew
    int reweightings = 2;  // a warp
    int sweeps = 6;        // of red-black over-relaxation, a reweighting
    int coarsest = 16;     // pixels: no pyramid level has a shorter side
    int finest_level = 0;  // 0: full resolution; 1: half, and the flow enlarged
};

// The flow from `from` to `to`, one-channel images of the same size and any brightness scale. `initial`, if given, is where
// to begin, at the level at which nothing larger remains to be found; else zero at the coarsest level. Deterministic: the same
// bits for any thread count. Non-finite pixels count as their image's mean.
FlowField robust_flow(const Image& from, const Image& to, const RobustFlowOptions& options = {},
                      const FlowField* initial = nullptr);

}  // namespace ols
