// SPDX-License-Identifier: MIT
// What is told of pixels whose values were not measured.
// links: ols_rf
#include "rf/mask_counts.hpp"

#include <gtest/gtest.h>

#include "image/target.hpp"

using namespace ols;

TEST(MaskCounts, every_bit_is_counted_over_all_strips) {
    MaskCounts counts;
    counts.add({0, mask_saturated, mask_saturated | mask_unsolved, mask_estimated});
    counts.add({mask_unsolved | mask_missing, mask_outside, mask_misaligned, mask_clamped});
    const nlohmann::json expected = {{"pixels", 8},  {"saturated", 2}, {"missing", 1},  {"outside", 1},
                                     {"clamped", 1}, {"estimated", 1}, {"unsolved", 2}, {"misaligned", 1}};
    EXPECT_EQ(counts.report(), expected);
}

TEST(MaskCounts, unsolved_estimated_misaligned_and_clamped_pixels_are_warned_of_and_no_others) {
    MaskCounts counts;
    counts.add({0, mask_saturated | mask_missing | mask_outside, 0, 0});
    EXPECT_TRUE(counts.warnings().empty());
    counts.add({mask_unsolved, mask_unsolved, mask_estimated, mask_misaligned});
    const auto warnings = counts.warnings();
    ASSERT_EQ(warnings.size(), 3u);
    EXPECT_TRUE(warnings[0].starts_with("1 of 8 pixels (12 %) are estimates")) << warnings[0];
    EXPECT_TRUE(warnings[1].starts_with("2 of 8 pixels (25 %) are not solved and are 0")) << warnings[1];
    EXPECT_NE(warnings[1].find("--estimate"), std::string::npos);
    EXPECT_TRUE(warnings[2].starts_with("1 of 8 pixels (12 %) may be wrong")) << warnings[2];
}
