// SPDX-License-Identifier: MIT
// What is done with flow fields: resizing, concatenation, warping.
#pragma once

#include <cstddef>
#include <vector>

#include "image/flow_field.hpp"
#include "image/frame.hpp"

namespace ols {

// Two images of one channel and the same size, and where they show the subject: 1 where a pixel is seen, 0 where it is
// saturated, lost or not a number; empty when all of it is seen. What is not seen is finite all the same.
struct FlowPair {
    Image from, to;
    Image from_seen, to_seen;
};

// The flow at half or double resolution and the like: vectors scale with the image. Bilinear, edges held.
FlowField resized(const FlowField& flow, int width, int height);

// First a, then b: a + b where a leads. Where a leads outside, b's nearest edge counts.
FlowField concatenated(const FlowField& a, const FlowField& b);

// Local flow as the target sees it: `local` at position + base, bilinear. Where `base` leads outside, local's nearest edge counts.
FlowField seen_from_target(const FlowField& base, const FlowField& local);

// A one-channel image seen through a flow: out(x, y) = image(x + u, y + v) by cubic convolution (Keys 1981, a = -1/2), edges
// held. `inside` (if given) becomes 0 where the flow leads outside the image, else 1.
Image warped(const Image& image, const FlowField& flow, std::vector<unsigned char>* inside = nullptr);

}  // namespace ols
