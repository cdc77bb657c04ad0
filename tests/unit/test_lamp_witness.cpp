// SPDX-License-Identifier: MIT
// links: ols_develop
#include "develop/lamp_witness.hpp"

#include <gtest/gtest.h>

#include "lit_picture.hpp"

using namespace ols;

namespace {

constexpr double counts = 25;

struct Stage {
    LitPicture picture{"s159", counts};
    LampWitness witness{picture.basis, named_lamps()};

    std::vector<LampFinding> target(const std::vector<double>& factor, unsigned seed) {
        return witness.judge(picture.samples(LitPicture::exposed(picture.rows(factor), seed)));
    }
    // The lamp whose picture is the brightest: the sheet faces it.
    int bright_lamp() const {
        int best = 0;
        double most = 0;
        for (int lamp = 0; lamp < picture.basis.lamps; ++lamp) {
            double sum = 0;
            for (const double value : picture.lamps[size_t(lamp)]) sum += value;
            if (sum > most) most = sum, best = lamp;
        }
        return best;
    }
};

std::vector<double> with(int lamp, double factor) {
    std::vector<double> factors(156, 1.0);
    factors[size_t(lamp)] = factor;
    return factors;
}

}  // namespace

TEST(LampWitness, lamps_that_are_all_as_they_should_be_are_not_named) {
    Stage stage;
    for (unsigned seed = 0; seed < 10; ++seed) EXPECT_TRUE(stage.target({}, seed).empty()) << seed;
}

TEST(LampWitness, a_lamp_that_is_dark_from_the_beginning_is_named_by_its_neighbours) {
    Stage stage;
    const int lamp = stage.bright_lamp();
    const auto findings = stage.target(with(lamp, 0), 1);
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0].image, lamp);
    EXPECT_NEAR(findings[0].factor, 0, 3 * findings[0].spread);
    EXPECT_FALSE(findings[0].is_new);
}

TEST(LampWitness, two_dark_lamps_side_by_side_are_both_named) {
    Stage stage;
    const auto lights = named_lamps();
    const int lamp = stage.bright_lamp();
    int beside = lamp == 0 ? 1 : 0;
    for (int other = 0; other < 156; ++other)
        if (other != lamp && dot(lights[size_t(other)].direction, lights[size_t(lamp)].direction) >
                                 dot(lights[size_t(beside)].direction, lights[size_t(lamp)].direction))
            beside = other;
    auto factors = with(lamp, 0);
    factors[size_t(beside)] = 0;
    const auto findings = stage.target(factors, 2);
    ASSERT_EQ(findings.size(), 2u);
    EXPECT_EQ(std::minmax(findings[0].image, findings[1].image), std::minmax(lamp, beside));
}

// The factor is known to a few of the spread that it is given with.
TEST(LampWitness, a_lamp_that_dims_during_the_take_is_named_with_its_factor) {
    Stage stage;
    const int lamp = stage.bright_lamp();
    EXPECT_TRUE(stage.target({}, 1).empty());
    EXPECT_TRUE(stage.target({}, 2).empty());
    const auto findings = stage.target(with(lamp, 0.7), 3);
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0].image, lamp);
    EXPECT_TRUE(findings[0].is_new);
    EXPECT_NEAR(findings[0].factor, 0.7, 4 * findings[0].spread);
}

// All lamps alike: another exposure, not a lamp.
TEST(LampWitness, light_that_is_less_of_all_lamps_names_none) {
    Stage stage;
    EXPECT_TRUE(stage.target({}, 1).empty());
    EXPECT_TRUE(stage.target(std::vector<double>(156, 0.5), 2).empty());
}

TEST(LampWitness, what_is_too_dark_to_be_judged_is_counted) {
    Stage stage;
    EXPECT_TRUE(stage.target({}, 1).empty());
    int behind = 0;  // the sheet
    for (const auto& lamp : stage.picture.lamps) behind += *std::ranges::max_element(lamp) == 0;
    EXPECT_GT(behind, 0);
    EXPECT_GE(stage.witness.unjudged(), behind);
    EXPECT_LT(stage.witness.unjudged(), 156);
}
