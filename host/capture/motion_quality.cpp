// SPDX-License-Identifier: MIT
// The presets.
#include "capture/motion_quality.hpp"

namespace ols {

namespace {

std::vector<MotionQuality> presets() {
    const FlowOptions quick{DisFlowOptions{.finest_scale = 1, .patch_stride = 4, .iterations = 12, .refinements = 0}};
    BroxFlowOptions half, fine;
    half.finest_level = 1;
    fine.ratio = 0.8;
    fine.warps = fine.finest_warps = 3;
    BroxFlowOptions refine_half = half, refine_fine = fine;
    refine_half.coarsest = refine_fine.coarsest = 120;  // what a concatenation misses is a few pixels at most
    return {{},
            {"preview", true, {.local = quick, .refinement = {}, .reduction = 2}, 0.1f},
            {"standard", true, {.local = {half}, .refinement = FlowOptions{refine_half}}, 0.02f},
            {"final", true, {.local = {fine}, .refinement = FlowOptions{refine_fine}}, 0.005f}};
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
