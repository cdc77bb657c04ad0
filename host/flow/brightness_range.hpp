// SPDX-License-Identifier: MIT
// Between which brightnesses nearly all of an image lies.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <functional>
#include <vector>

namespace ols {

struct BrightnessRange {
    float low, high;
};

// Of finite values, in an order that is not kept, without the `tail` least and the `tail` greatest. For a tail of few among many,
// which a heap holds: an image costs little more than a look at each value.
inline BrightnessRange range_without(std::vector<float>& values, size_t tail) {
    assert(tail < values.size());
    const auto last = values.begin() + std::ptrdiff_t(tail);
    std::partial_sort(values.begin(), last + 1, values.end());
    const float low = *last;
    std::partial_sort(values.begin(), last + 1, values.end(), std::greater<>());
    return {low, *last};
}

}  // namespace ols
