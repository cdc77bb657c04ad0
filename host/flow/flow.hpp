// SPDX-License-Identifier: MIT
// Optical flow: one call for every method, and how far a flow can be trusted.
#pragma once

#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "flow/brox_flow.hpp"
#include "flow/dis_flow.hpp"
#include "flow/flow_field.hpp"
#include "flow/robust_flow.hpp"
#include "result.hpp"

namespace ols {

struct FlowOptions {
    std::variant<DisFlowOptions, RobustFlowOptions, BroxFlowOptions> method = BroxFlowOptions{};
    // Pixels at or above it are not seen, as those that are no number: they say nothing, their neighbours speak for them.
    // In the images' own unit.
    float saturation = std::numeric_limits<float>::infinity();
};

// The methods of docs/motion.md by name, from the fastest on.
std::vector<std::string> flow_method_names();

// Those that only mend a flow that is given as `initial` and nearly right (within about a pixel at the resolution that they
// work at), for a fraction of the time.
std::vector<std::string> flow_refinement_names();

// Of either. Error: no such method; says which there are.
Result<FlowOptions> flow_method(const std::string& name);

// Where each pixel of `from` is found in `to`, in pixels: one-channel images of the same size, at least 16 pixels a side, in
// any unit of brightness, exposed differently or not. `initial`, if given, is a flow of their size to begin with.
// Always finite. Where no data says anything (textureless, dark, not seen) the flow is what its surroundings say; where one of
// the images shows nothing at all it is `initial`, or zero.
// Deterministic: the same bits for any thread count. Errors: sizes and channels that do not fit, settings out of range.
Result<FlowField> estimate_flow(const Image& from, const Image& to, const FlowOptions& options = {},
                                const FlowField* initial = nullptr);

// An image made ready for any method, for who needs several flows of it.
struct FlowImage {
    Image image;           // in a range of about 0 to 1
    Image seen;            // as FlowPair's
    bool is_even = false;  // it shows nothing at all
};
// One channel, at least 16 pixels a side.
FlowImage flow_image(Image image, float saturation = std::numeric_limits<float>::infinity());
// The same flow, bit for bit, as from the images themselves; the options' saturation is the images' already.
Result<FlowField> estimate_flow(const FlowImage& from, const FlowImage& to, const FlowOptions& options = {},
                                const FlowField* initial = nullptr);

// The forward-backward check: how well `backward` (from `to` to `from`) leads back what `forward` led away, a pixel of `from`
// each: 1 / (1 + (miss / allowed)^2), allowed = 0.5 pixels + 1 % of both vectors' lengths (what flow errs and bilinear reading
// of `backward` adds). 1: it comes back exactly; 1/2: it misses by as much as is allowed; 0: it leads outside the image, or
// is no number. Occluded pixels have no counterpart, so they mostly end on what covers them and miss. Fields of one size.
std::vector<float> confidence(const FlowField& forward, const FlowField& backward);
// The same for who has their concatenation.
std::vector<float> confidence_of(const FlowField& forward, const FlowField& round_trip);

}  // namespace ols
