// SPDX-License-Identifier: MIT
// Floats to halves in bulk against Imath one by one, where they could differ: at every half, between every two, and one step beside.
// links: ols_image
#include "image/half_samples.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace ols {
namespace {

TEST(HalfSamples, are_those_of_imath_bit_for_bit) {
    std::vector<float> floats;
    for (uint32_t bits = 0; bits < 0x10000; ++bits) {
        const float value = float(half(half::FromBits, uint16_t(bits)));
        if (!std::isfinite(value)) continue;
        const float above = float(half(half::FromBits, uint16_t(bits + 1)));
        const float between = std::isfinite(above) ? (value + above) / 2 : value;
        for (const float v : {value, between})
            for (const float w : {v, std::nextafter(v, -HUGE_VALF), std::nextafter(v, HUGE_VALF)}) floats.push_back(w);
    }
    floats.push_back(std::numeric_limits<float>::denorm_min());
    for (const size_t left_out : {0, 1, 5}) {
        const std::span<const float> some(floats.data() + left_out, floats.size() - 2 * left_out);
        std::vector<half> halves(some.size());
        to_halves(some, halves.data());
        for (size_t i = 0; i < some.size(); ++i)
            ASSERT_EQ(halves[i].bits(), half(some[i]).bits()) << std::bit_cast<uint32_t>(some[i]);
    }
}

TEST(HalfSamples, within_is_false_for_one_sample_beyond_wherever_it_stands) {
    std::vector<float> values(37, -65504.0f);
    EXPECT_TRUE(all_within(values, 65504));
    EXPECT_TRUE(all_within({}, 65504));
    for (const float beyond : {65505.0f, -65505.0f, HUGE_VALF, -HUGE_VALF, std::numeric_limits<float>::quiet_NaN()})
        for (size_t i = 0; i < values.size(); ++i) {
            auto changed = values;
            changed[i] = beyond;
            EXPECT_FALSE(all_within(changed, 65504)) << beyond << " at " << i;
        }
}

}  // namespace
}  // namespace ols
