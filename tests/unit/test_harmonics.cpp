// SPDX-License-Identifier: MIT
// Real spherical harmonics against closed forms and quadrature, and their patterns against the functions they stand for.
// links: ols_stage
#include "stage/harmonics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "stage/stage.hpp"

using namespace ols;

namespace {

constexpr double pi = std::numbers::pi;

// Every direction's closed form in the stage's axes, degree 2 and below, with z of the textbooks as our y, their x as our z.
double textbook(int l, int m, const Vec3& d) {
    const double x = d.z, y = d.x, z = d.y;
    if (l == 0) return 0.5 / std::sqrt(pi);
    if (l == 1) return std::sqrt(3 / (4 * pi)) * (m < 0 ? y : m == 0 ? z : x);
    switch (m) {
        case -2: return std::sqrt(15 / pi) / 2 * x * y;
        case -1: return std::sqrt(15 / pi) / 2 * y * z;
        case 0: return std::sqrt(5 / pi) / 4 * (3 * z * z - 1);
        case 1: return std::sqrt(15 / pi) / 2 * x * z;
        default: return std::sqrt(15 / pi) / 4 * (x * x - y * y);
    }
}

}  // namespace

TEST(Harmonics, up_to_degree_two_are_the_textbooks_polynomials) {
    for (const auto& lamp : default_stage().lamps)
        for (int l = 0; l <= 2; ++l)
            for (int m = -l; m <= l; ++m)
                EXPECT_NEAR(real_harmonic(l, m, lamp.direction), textbook(l, m, lamp.direction), 1e-12)
                    << l << " " << m;
}

TEST(Harmonics, are_orthonormal_over_the_sphere_up_to_the_highest_order) {
    // The midpoint rule in azimuth is exact for these; in height, fine enough for 1e-3.
    constexpr int heights = 800, azimuths = 64;
    const std::pair<int, int> functions[] = {{0, 0},   {1, -1}, {3, 2},   {5, 0}, {7, -7},
                                             {10, 10}, {10, 3}, {10, -3}, {9, 3}};
    for (const auto& [l, m] : functions)
        for (const auto& [k, n] : functions) {
            double sum = 0;
            for (int i = 0; i < heights; ++i)
                for (int j = 0; j < azimuths; ++j) {
                    const double y = -1 + (2 * i + 1.0) / heights, a = 2 * pi * j / azimuths, r = std::sqrt(1 - y * y);
                    const Vec3 d{r * std::sin(a), y, r * std::cos(a)};
                    sum += real_harmonic(l, m, d) * real_harmonic(k, n, d);
                }
            const double integral = sum * 4 * pi / (heights * azimuths);
            EXPECT_NEAR(integral, l == k && m == n ? 1 : 0, 1e-3) << l << "," << m << " " << k << "," << n;
        }
}

TEST(Harmonics, split_parts_make_up_their_function_to_half_a_level) {
    const auto lamps = default_stage().lamps;
    const auto patterns = harmonic_patterns(lamps, 4, HarmonicSign::split, 255);
    EXPECT_EQ(patterns.size(), 2u * 25 - 1) << "the constant has no negative part";
    std::map<std::string, const HarmonicPattern*> named;
    for (const auto& pattern : patterns) named[pattern.name] = &pattern;
    for (int l = 1; l <= 4; ++l)
        for (int m = -l; m <= l; ++m) {
            const std::string name = "Y(" + std::to_string(l) + "," + std::to_string(m) + ")";
            const HarmonicPattern &plus = *named.at(name + "+"), &minus = *named.at(name + "-");
            for (size_t lamp = 0; lamp < lamps.size(); ++lamp) {
                EXPECT_EQ(std::min(plus.levels[lamp], minus.levels[lamp]), 0);
                const double level = plus.levels[lamp] - minus.levels[lamp];
                EXPECT_NEAR(level * plus.scale / 255, real_harmonic(l, m, lamps[lamp].direction),
                            plus.scale * 0.5001 / 255);
            }
            EXPECT_EQ(std::max(*std::max_element(plus.levels.begin(), plus.levels.end()),
                               *std::max_element(minus.levels.begin(), minus.levels.end())),
                      255)
                << "the levels are used to the full";
        }
}

TEST(Harmonics, an_offset_pattern_is_its_function_above_half_light) {
    const auto lamps = default_stage().lamps;
    const auto patterns = harmonic_patterns(lamps, 2, HarmonicSign::offset, 255);
    ASSERT_EQ(patterns.size(), 9u);
    for (size_t lamp = 0; lamp < lamps.size(); ++lamp) {
        const double value = patterns[2].scale * (2 * patterns[2].levels[lamp] / 255.0 - 1);
        EXPECT_NEAR(value, real_harmonic(1, 0, lamps[lamp].direction), patterns[2].scale * 1.0001 / 255);
    }
}
