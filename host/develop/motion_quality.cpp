// SPDX-License-Identifier: MIT
// The presets.
#include "develop/motion_quality.hpp"

namespace ols {

namespace {

std::vector<MotionQuality> presets() {
    const auto method = [](const char* name) { return *flow_method(name); };
    // In small images patches find what moves far more surely than a pyramid does.
    const FlowOptions quick{DisFlowOptions{.finest_scale = 0, .patch_stride = 5, .iterations = 12, .refinements = 0}};
    return {{},
            {.name = "preview",
             .compensates = true,
             .flow = {.local = quick, .refinement = {}, .reduced_side = 120},
             .flow_apart_s = 1 / 60.0,
             .line_tolerance_steps = 1.2f},
            {.name = "standard",
             .compensates = true,
             .flow = {.local = method("brox-half"), .refinement = method("refine-half")},
             .interpolates = true},
            {.name = "final",
             .compensates = true,
             .flow = {.local = method("robust"), .refinement = method("refine-robust")},
             .line_tolerance_steps = 0.05f,
             .interpolates = true}};
}

}  // namespace

std::vector<std::string> motion_quality_names() {
    std::vector<std::string> names;
    for (const MotionQuality& quality : presets()) names.push_back(quality.name);
    return names;
}

Result<MotionQuality> motion_quality(const std::string& name) {
    std::string known;
    for (MotionQuality& quality : presets()) {
        if (quality.name == name) return quality;
        known += (known.empty() ? "" : ", ") + quality.name;
    }
    return fail("no motion quality '" + name + "': there are " + known);
}

}  // namespace ols
