// SPDX-License-Identifier: MIT
// The range that leaves a tail out at either end, against values that are sorted.
// links: ols_flow
#include <gtest/gtest.h>

#include <random>

#include "flow/brightness_range.hpp"

using namespace ols;

namespace {

// Many alike, as counts are.
std::vector<float> counts(size_t number, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<float> values(number);
    for (float& value : values) value = float(random() % 40) - 8;
    return values;
}

}  // namespace

TEST(BrightnessRange, is_what_stands_a_tail_from_either_end_of_the_sorted_values) {
    for (const size_t number : {1u, 2u, 7u, 100u, 1001u})
        for (const size_t tail : {size_t(0), number / 100, number / 3, number / 2, number - 1}) {
            std::vector<float> values = counts(number, unsigned(number + tail)), sorted = values;
            std::ranges::sort(sorted);
            const BrightnessRange range = range_without(values, tail);
            EXPECT_EQ(range.low, sorted[tail]) << number << " values, tail " << tail;
            EXPECT_EQ(range.high, sorted[number - 1 - tail]) << number << " values, tail " << tail;
        }
}

TEST(BrightnessRange, of_all_of_them_is_from_the_least_to_the_greatest) {
    std::vector<float> values = {3, -1, 7, 2};
    const BrightnessRange range = range_without(values, 0);
    EXPECT_EQ(range.low, -1);
    EXPECT_EQ(range.high, 7);
}
