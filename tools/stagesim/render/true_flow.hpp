// SPDX-License-Identifier: MIT
// The true flow between two moments of a scene, from its geometry.
#pragma once

#include <string>
#include <vector>

#include "flow/flow_field.hpp"
#include "scene/scene.hpp"
#include "stage/stage.hpp"

namespace ols {

struct TrueFlow {
    FlowField flow;  // NaN where the camera sees nothing at `from`
    std::vector<unsigned char>
        visible;  // 1 where what is seen at `from` is seen at `to` too; 0 where it is not, or nothing is
};

// Each pixel's middle at `from_us` follows its surface point to `to_us`: exact for the pixel's middle, whatever else the
// pixel shows. A point is visible at `to_us` if it lies within the image and nothing stands before it.
TrueFlow true_flow(const Scene& scene, const CameraConfig& camera, double from_us, double to_us);

// An OpenEXR file of two parts: `flow` with the channels forward.u and forward.v (32-bit float, pixels, v downwards), and
// `mask` with the channel visible (half: 1 or 0). The moments are the header's double attributes fromUs and toUs. Written
// under a temporary name and renamed.
Status write_true_flow(const std::string& path, const TrueFlow& flow, double from_us, double to_us);

}  // namespace ols
