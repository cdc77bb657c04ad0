// SPDX-License-Identifier: MIT
// A glint that saturates half of a multiplexed basis while it moves: what is left of it with and without its clipped samples.
// links: ols_develop
#include <gtest/gtest.h>

#include <numeric>

#include "../stability/moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr int glint_lamp = 77;
constexpr double px_a_cycle = 10, matte_share = 0.1, radius = 2.5;

// A small disc on textured skin, which moves with it; one lamp shines in it as if it were 60 white surfaces.
Scene glint_on_skin(double moves) {
    const auto offset = [=](double slots) { return Offset{moves * slots / 180, 0}; };
    const Layer skin{wavy(5), INFINITY, offset},
        glint{even(matte_share), radius, offset, {0, 0, 1}, [](int lamp) { return lamp == glint_lamp ? 600.0 : 0.0; }};
    return {.layers = {skin, glint}, .width = 80, .height = 64, .is_noisy = true};
}

// The pixels in the disc, but for those that its edge blends or the warp's and the flow's softness reaches.
std::vector<size_t> inside() {
    std::vector<size_t> pixels;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 80; ++x)
            if (std::hypot(x - 39.5, y - 31.5) < radius - 1) pixels.push_back(size_t(80 * y + x));
    return pixels;
}

// White, in r.
double clipping_level(const Take& take) {
    for (const Slot& slot : take.sequence().slots)
        if (slot.kind == SlotKind::basis)
            return double(white_counts - black_counts) / counts_per_us / (slot.exposure_ticks / double(ticks_per_us));
    return 0;
}

size_t count(const Target& target, uint32_t bits) {
    return size_t(std::ranges::count_if(target.mask, [bits](uint32_t mask) { return (mask & bits) == bits; }));
}

}  // namespace

TEST(MovingGlint, has_no_hole_where_clipped_samples_count) {
    Take take(glint_on_skin(px_a_cycle), "s159");
    const double level = clipping_level(take);
    const Target without = take.develop("standard", take.middle_target(), {Estimate::none, {}, 2}),
                 target = take.develop("standard", take.middle_target(), {Estimate::clipped, {}, 2});
    EXPECT_GT(count(without, mask_saturated | mask_unsolved), 20u);
    EXPECT_EQ(count(target, mask_unsolved), 0u);
    EXPECT_EQ(count(target, mask_saturated | mask_estimated), count(without, mask_saturated | mask_unsolved));
    EXPECT_EQ(count(target, mask_misaligned), count(without, mask_misaligned));
    for (const size_t p : inside()) {
        EXPECT_EQ(without.lamps[glint_lamp][p], 0);
        // All that the rows say more than white is cut off; the matte share of some 78 lamps is part of what they do.
        EXPECT_LT(target.lamps[glint_lamp][p], level);
        EXPECT_GT(target.lamps[glint_lamp][p], 0.9 * level);
    }
    for (size_t p = 0; p < target.mask.size(); ++p) {
        if (target.mask[p] & mask_estimated) continue;
        for (size_t i = 0; i < target.lamps.size(); ++i) ASSERT_EQ(target.lamps[i][p], without.lamps[i][p]);
    }
}

// Without motion the counts of a still camera are clipped where they are: interpolation adds nothing to that.
TEST(MovingGlint, that_stands_still_is_what_it_is_without_compensation) {
    Take take(glint_on_skin(0), "s159");
    const Target still = take.develop("none", take.middle_target(), {Estimate::clipped, {}, 2}),
                 target = take.develop("standard", take.middle_target(), {Estimate::clipped, {}, 2});
    for (const size_t p : inside()) {
        EXPECT_EQ(target.mask[p] & ~uint32_t(mask_misaligned), uint32_t(mask_saturated | mask_estimated));
        for (size_t i = 0; i < target.lamps.size(); ++i)
            EXPECT_NEAR(target.lamps[i][p], still.lamps[i][p], 0.01 * clipping_level(take));
    }
}

TEST(MovingGlint, is_the_same_on_one_thread_and_on_two) {
    Take take(glint_on_skin(px_a_cycle), "s159");
    const Target one = take.develop("preview", take.middle_target(), {Estimate::clipped, {}, 1}),
                 two = take.develop("preview", take.middle_target(), {Estimate::clipped, {}, 2});
    EXPECT_EQ(one.lamps, two.lamps);
    EXPECT_EQ(one.mask, two.mask);
    EXPECT_EQ(one.variance, two.variance);
}
