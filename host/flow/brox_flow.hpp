// SPDX-License-Identifier: MIT
// Variational optical flow after Brox, Bruhn, Papenberg and Weickert, "High accuracy optical flow estimation based on a theory
// for warping" (ECCV 2004), with the two terms that Peers, Tamura, Matusik and Debevec, "Post-production facial performance
// relighting using reflectance transfer" (SIGGRAPH 2007, section 5.1, equations 5 and 6) add.
#pragma once

#include <vector>

#include "flow/flow_pyramid.hpp"

namespace ols {

// Where a pixel of `from` is known to be found in `to`: at (x + u, y + v).
struct FlowHint {
    float x, y, u, v;
};

// The energy, with Psi(s2) = sqrt(s2 + 1e-6), is the sum over all pixels of
//     Psi(brightness difference^2 + gradient * difference of the gradients^2) + smoothness * Psi(|grad u|^2 + |grad v|^2)
//     + hint * sum_i phi(|x - x_i|) Psi(|w - h_i|^2) + keep * r(|I_x - I'_{x + w'}|) Psi(|w - w'|^2),
// with phi(d) = exp(-d^2 / (2 hint_radius^2)), w' the initial flow, and r falling in a line from 1 to 0 at keep_threshold.
// Nested fixed-point iterations as in the paper: the outer ones warp, the inner ones hold Psi' while they relax. Deviations: the
// gradients that are compared are those of the warped image, not the warped gradients, so that they agree under rotation and
// zoom, too; derivatives are of the mean of both images; what is compared is the images' detail; the first warp of a coarse
// level takes 1e-2 for the 1e-6 of the smoothness term, as an even flow would otherwise need many sweeps to change.
struct BroxFlowOptions {
    FlowDetail detail = {};
    float gradient = 1;
    float smoothness = 0.8f;
    double ratio = 0.5;          // of a pyramid level's sides to those of the level before; the paper has 0.95
    int warps = 2;               // a level; the coarsest has at least six, as all motion is still to be found there
    int finest_warps = 2;        // at the finest level, which costs as much as all others together
    int reweightings = 2;        // a warp
    int sweeps = 6;              // of red-black over-relaxation, a reweighting
    int coarsest = 16;           // pixels: no pyramid level has a shorter side
    int finest_level = 0;        // where the pyramid ends; the flow is enlarged from there
    double initial_octaves = 1;  // by which the level where a given flow is taken up is coarser than the finest

    std::vector<FlowHint> hints = {};
    float hint = 10;              // weight at the hint itself
    float hint_radius = 20;       // pixels of full resolution
    float keep = 0;               // weight of the initial flow where it fits perfectly; 0 takes it as a beginning only
    float keep_threshold = 0.1f;  // in standard deviations of detail
};

// The flow between the two images of a pair, from zero or from `initial`. Deterministic: the same bits for any thread count
// and on every vector path.
FlowField brox_flow(const FlowPair& pair, const BroxFlowOptions& options, const FlowField* initial = nullptr);

}  // namespace ols
