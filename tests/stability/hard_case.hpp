// SPDX-License-Identifier: MIT
// A hard case: what the naive method gives, what ours gives, and the bound that ours must keep. Each file of this folder
// is one hard case; each TEST in it that calls one of these functions (once) is a row of docs/stability.md, which
// table.py makes of them.
//
//     // Bound: the derivation, in words and formulas, never a figure that was tuned until the test passed.
//     TEST(Int16Wrap, of_every_corner_value) {
//         ...
//         expect_within({"int16 wrap-around at every corner value, s159"}, naive, ours, bound, "counts");
//     }
//
// `naive` is computed by the test, honestly: what a competent first version would do (float32 Gauss, a plain int16 sum).
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace ols {

// For cases whose results are no two numbers (a refusal, a mark); the test itself expects what has to hold.
inline void record_case(const std::string& name, const std::string& naive, const std::string& ours,
                        const std::string& bound) {
    testing::Test::RecordProperty("case", name);
    testing::Test::RecordProperty("naive", naive);
    testing::Test::RecordProperty("ours", ours);
    testing::Test::RecordProperty("bound", bound);
}

// "0.00012 counts", "Inf", "0"; without a unit, the number alone.
inline std::string with_unit(double value, const std::string& unit) {
    if (std::isnan(value)) return "NaN";
    if (std::isinf(value)) return value > 0 ? "Inf" : "-Inf";
    if (value == 0) return "0";
    char text[32];
    std::snprintf(text, sizeof text, "%.2g", value);
    return unit.empty() ? text : text + (" " + unit);
}

// Errors (or what else should be small) of the two methods. Ours keeps the bound, and the naive one does not: else the
// case is not hard, and the row proves nothing.
inline void expect_within(const std::string& name, double naive, double ours, double bound, const std::string& unit) {
    EXPECT_LE(ours, bound) << name;
    EXPECT_FALSE(naive <= bound) << name << ": the naive method keeps the bound, too: " << naive;
    record_case(name, with_unit(naive, unit), with_unit(ours, unit), with_unit(bound, unit));
}

}  // namespace ols
