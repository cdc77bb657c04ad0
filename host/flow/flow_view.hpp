// SPDX-License-Identifier: MIT
// Two images seen through the flow between them: what the data terms of the variational flows are linearised from.
#pragma once

#include "flow/flow_field.hpp"
#include "flow/flow_planes.hpp"

namespace ols {

// With `to` warped by the flow so far (cubic convolution, Keys 1981, a = -1/2): its mean with `from`, from which derivatives
// are taken (both images' structure, halfway: less noise, no bias to either), and `to` minus `from`. The warped image is brought
// to the energy of `from` first, measured where both look alike: what is left of unequal exposure. Borders hold the edge.
struct FlowView {
    PaddedPlane mean, difference;
    PaddedPlane valid;  // how much of both images is seen, 0 to 1; 0 where the flow leads outside

    FlowView(int width, int height) : mean(width, height), difference(width, height), valid(width, height) {}
};

PaddedPlane padded(const Image& image);  // of one channel

// A pair that is seen through one flow after the other. Deterministic; the same bits on every vector path.
class FlowViewer {
  public:
    explicit FlowViewer(const FlowPair& pair);
    const FlowView& through(const FlowField& flow);  // of the pair's size; until the next call

  private:
    PaddedPlane from_, to_, to_seen_;  // to_seen_ is empty where all is seen, and so is
    Image from_seen_;
    FlowView view_;
};

// The derivative along rows and along columns, five points wide; its border holds, too.
void derivative_x(const PaddedPlane& plane, PaddedPlane& out);
void derivative_y(const PaddedPlane& plane, PaddedPlane& out);

// Between the layouts; the checkered plane has all rows of the image.
void split(const float* rows, int width, CheckeredPlane& out);
void split(const PaddedPlane& plane, CheckeredPlane& out);
void join(CheckeredPlane& plane, int width, float* rows);

}  // namespace ols
