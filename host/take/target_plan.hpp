// SPDX-License-Identifier: MIT
// Target plan: the targets that a take is to have, in order, and which frames each waits for.
#pragma once

#include <cstdint>
#include <vector>

#include "develop/lazy_basis.hpp"
#include "take/take.hpp"

namespace ols {

struct PlannedTarget {
    uint64_t target = 0;  // number of a performance's tracking frame, or a cycle
    FrameRange frames;    // those it waits for and may use
};

std::vector<PlannedTarget> plan_targets(const Sequence& sequence, const TakeMasks& masks, const TakeTargets& targets);

}  // namespace ols
