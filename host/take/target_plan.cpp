// SPDX-License-Identifier: MIT
// A target at every so manieth tracking frame, or one a cycle.
#include "take/target_plan.hpp"

#include <algorithm>

namespace ols {

std::vector<PlannedTarget> plan_targets(const Sequence& sequence, const TakeMasks& masks, const TakeTargets& targets) {
    const uint64_t length = sequence.slots.size(), last = sequence.trigger_count() - 1;
    std::vector<PlannedTarget> plan;
    if (targets.every > 0) {
        for (const uint64_t target : target_numbers(sequence, targets.every))
            plan.push_back({target, frames_around(sequence, target)});
        return plan;
    }
    const uint64_t beside = masks.fill_from_neighbours ? length : 0;
    for (uint64_t cycle = 0; cycle < uint64_t(sequence.config.cycles); ++cycle) {
        const uint64_t first = cycle * length;
        plan.push_back({cycle, {std::max(first, beside) - beside, std::min(first + length - 1 + beside, last)}});
    }
    return plan;
}

}  // namespace ols
