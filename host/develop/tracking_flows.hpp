// SPDX-License-Identifier: MIT
// Tracking flows: where the subject of one instant is found at the tracking frames around it (Wenger section 6).
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "flow/evenness.hpp"
#include "flow/flow.hpp"
#include "result.hpp"

namespace ols {

// What the flow between tracking frames is made with.
struct TrackingFlowOptions {
    FlowOptions local;  // between neighbouring tracking frames, both ways
    // Of a long-range flow, which a concatenation begins: directly between the target's tracking frame and one that is
    // farther away. Nothing: concatenations stand as they are. Saturation is `local`'s.
    std::optional<FlowOptions> refinement;
    // Flow is found in images a half or a quarter as large, while their shorter side keeps this many pixels; 0: in images as they
    // are.
    int reduced_side = 0;
    int threads = 0;  // 0: as many as there are processors. Any number gives the same bits.
};

// A flow from an instant to another one. Fields have the size of the images that flow is found in, rounded up, and vectors
// are in their pixels.
struct MotionKnot {
    double tick = 0;
    FlowField flow;
    std::vector<float> confidence;  // of each pixel (flow.hpp, or evenness.hpp where noise is known)
    bool is_instant = false;        // the instant itself
};

// Ascending in time, the instant itself among them, with zero flow and confidence 1. Between two knots the subject moves at
// an even pace.
using MotionPath = std::vector<MotionKnot>;

// Takes the tracking frames of a take in their order and answers for instants among them. A frame that was lost is left
// out: flow then spans the gap.
class TrackingFlows {
  public:
    explicit TrackingFlows(TrackingFlowOptions options);

    // One channel, all of one size, at least 16 pixels a side, NaN where nothing was seen. Ticks ascend. `sigma`: the
    // standard deviation of each pixel's noise, the same size; what shows nothing above it is left to its surroundings.
    // Empty: not known.
    // Error: another size than before, or too small.
    Status add(double tick, const Image& image, const Image& sigma = {});

    // Drops the tracking frames before the last one at or before `tick`.
    void forget_before(double tick);
    size_t frames() const { return frames_.size(); }  // that are kept

    // Times in ticks.
    struct Reach {
        double from, to;
    };
    // From the instant to the tracking frames from the last at or before reach.from to the first at or after reach.to, as far
    // as there are any; those that are needed for times within `refined` are refined, what lies farther stands as it is
    // concatenated. The instant is that of a tracking frame, or between two (one was lost): there the subject is taken to move
    // evenly from one to the other, and nothing is refined. An instant outside all tracking frames is alone with itself. Flows
    // between neighbours are kept for the next instant.
    Result<MotionPath> path(double instant, const Reach& reach, const Reach& refined);
    Result<MotionPath> path(double instant, double from, double to) { return path(instant, {from, to}, {from, to}); }

  private:
    struct Frame {
        double tick;
        FlowImage image;
        std::optional<Evenness> evenness;
        std::optional<FlowField> forward, backward;  // to the next frame, and from there
    };

    Status find_local_flows(size_t first, size_t last);
    struct Walk {
        // The instant's own frame, which long-range flows are refined against; null where there is none.
        const Frame* reference;
        Reach refined;
        int direction;
        size_t at, end;
    };
    Status walk(Walk walk, FlowField flow, FlowField back, MotionPath& path) const;

    const TrackingFlowOptions options_;
    int reduction_ = 1, width_ = 0, height_ = 0;  // of the images that flow is found in
    std::deque<Frame> frames_;
};

// When pixels move evenly along `between`, from one instant to another: the flows to either from an instant in between,
// `share` of the way. x' + share between(x') = x is solved by fixed-point iteration, which converges where the vectors of
// neighbouring pixels differ by less than a pixel; elsewhere, at edges of occlusion, either side's vector comes out.
struct SplitFlow {
    FlowField to_first, to_second;
};
SplitFlow split(const FlowField& between, double share);

}  // namespace ols
