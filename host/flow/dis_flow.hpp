// SPDX-License-Identifier: MIT
// Dense inverse search (Kroeger, Timofte, Dai and Van Gool, "Fast optical flow using dense inverse search", ECCV 2016), as
// OpenCV has it: fast, from 8-bit images.
#pragma once

#include "flow/flow_field.hpp"

namespace ols {

struct DisFlowOptions {
    bool search = true;     // false: only the final refinements, of the given flow (or zero)
    int finest_scale = 1;   // of the patches: 0 full resolution, 1 half, 2 a quarter; above 0 the flow is enlarged
    int patch_size = 8;     // pixels
    int patch_stride = 3;   // pixels from patch to patch
    int iterations = 25;    // of a patch's gradient descent
    int refinements = 5;    // fixed-point iterations of variational refinement (as Brox 2004) a scale; 0: none
    float smoothness = 20;  // of the refinement, with the weights of constant brightness and constant gradient
    float brightness = 5;
    float gradient = 10;
    int final_refinements = 0;  // fixed-point iterations more, from the flow found, at full resolution
};

// Deterministic: the same bits for any thread count. Non-empty images of the same size; `from_seen` as FlowPair's.
FlowField dis_flow(const Image& from, const Image& to, const Image& from_seen, const DisFlowOptions& options,
                   const FlowField* initial = nullptr);

}  // namespace ols
