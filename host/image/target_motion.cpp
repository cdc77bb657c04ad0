// SPDX-License-Identifier: MIT
#include "image/target_motion.hpp"

#include <fmt/format.h>

#include <cmath>

namespace ols {

Status check_motion_times(const std::vector<double>& times_s) {
    for (size_t i = 0; i < times_s.size(); ++i)
        if (!std::isfinite(times_s[i]) || times_s[i] == 0 || (i > 0 && !(times_s[i] > times_s[i - 1])))
            return fail(fmt::format(
                "the times of a target's motion must ascend and leave out 0, the target's own: time {} is {} s", i,
                times_s[i]));
    return Done{};
}

Status check_motion(const TargetMotion& motion, int width, int height) {
    if (const auto checked = check_motion_times(motion.times_s); !checked) return checked;
    if (motion.flows.size() != motion.times_s.size())
        return fail(fmt::format("a target's motion has {} times and {} flow fields: each time needs one",
                                motion.times_s.size(), motion.flows.size()));
    const size_t pixels = size_t(width) * size_t(height);
    for (size_t i = 0; i < motion.flows.size(); ++i) {
        const FlowField& flow = motion.flows[i];
        if (flow.width != width || flow.height != height || flow.u.size() != pixels || flow.v.size() != pixels)
            return fail(fmt::format("the flow to {:+.3f} ms is of {} x {} pixels, the target of {} x {}",
                                    motion.times_s[i] * 1e3, flow.width, flow.height, width, height));
        for (size_t p = 0; p < pixels; ++p)
            if (!std::isfinite(flow.u[p]) || !std::isfinite(flow.v[p]))
                return fail(fmt::format("the flow to {:+.3f} ms is not finite at pixel {}, {}", motion.times_s[i] * 1e3,
                                        p % size_t(width), p / size_t(width)));
    }
    return Done{};
}

}  // namespace ols
