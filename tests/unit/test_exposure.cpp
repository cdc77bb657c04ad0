// SPDX-License-Identifier: MIT
// The exposure that is derived against a white card's counts, summed here, and against Wenger's own exposures.
// links: ols_stage
#include "stage/exposure.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stage/playback.hpp"

using namespace ols;

namespace {

// Counts above black, and five deviations, of the white card in the brightest row.
double highest_counts(const Basis& basis, double exposure_us) {
    const StageConfig stage = default_stage();
    double brightest = 0;
    for (int r = 0; r < basis.rows; ++r) {
        double counts = 0;
        for (int i = 0; i < basis.lamps; ++i)
            counts += basis.light(r, i) * std::max(0.0, stage.lamps[size_t(i)].direction.z) * 2.52 * exposure_us;
        brightest = std::max(brightest, counts);
    }
    return brightest + 5 * (2.68 + 0.492 * std::sqrt(brightest));
}

}  // namespace

TEST(Exposure, one_lamp_and_three_have_the_412_us_of_the_paper) {
    for (const char* name : {"single", "triangle", "triangle300"})
        EXPECT_EQ(derived_exposure_us(*find_basis(name), default_stage(), 2160), 412) << name;
    EXPECT_NEAR(longest_exposure_us(2160), 412, 1e-9);
    EXPECT_NEAR(longest_exposure_us(1000), 1000 - (1e6 / 2160 - 412), 1e-9);
    EXPECT_NEAR(longest_exposure_us(20'000), 25, 1e-9);
}

TEST(Exposure, a_multiplexed_basis_is_lit_as_long_as_white_stays_below_saturation_and_not_a_step_longer) {
    for (const char* name : {"s159", "hadamard156", "s155", "paley163", "spherical_harmonics:4"}) {
        const Basis basis = *find_basis(name);
        const double exposure_us = derived_exposure_us(basis, default_stage(), 2160);
        const double step_us = basis.level_max == 1 ? 1 : 255 / 125.0;
        EXPECT_LE(highest_counts(basis, exposure_us), 4095 - 64) << name;
        EXPECT_GT(highest_counts(basis, exposure_us + step_us), 4095 - 64) << name;
        EXPECT_NEAR(std::remainder(exposure_us, step_us), 0, 1e-9) << name;
    }
}

TEST(Exposure, the_most_sensitive_camera_decides) {
    const Basis basis = *find_basis("s159");
    StageConfig stage = default_stage();
    const double one = derived_exposure_us(basis, stage, 2160);
    stage.cameras.push_back(stage.cameras[0]);
    stage.cameras[1].counts_per_us *= 4;
    EXPECT_NEAR(derived_exposure_us(basis, stage, 2160), one / 4, 1);
    stage.cameras[1].counts_per_us *= 1e4;
    EXPECT_EQ(derived_exposure_us(basis, stage, 2160), 1);
}
