// SPDX-License-Identifier: MIT
// Takes on which flow fails, in part or altogether: what compensation makes of them is never worse than none by more than a
// wrong vector can move.
// links: ols_develop
#include "hard_case.hpp"
#include "moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr double radius = 35;

// How much worse than none a target may be: for pixels that are called misaligned no vector is vouched for, so that a sample
// may be any that the scene has under its lamp, off by the range of the lamp's image. Others are off by what half a pixel of
// flow, the least that the check can tell, costs along the scene's slopes. Root mean squares over lamps and pixels.
double allowed_beyond_none(Take& take, const Target& ours) {
    double squares = 0, samples = 0;
    for (int lamp = 0; lamp < sphere_lamp_count; lamp += 3) {
        const std::vector<double> truth = take.truth(take.middle_target(), lamp);
        const auto [least, most] = std::ranges::minmax(truth);
        const size_t row = size_t(ours.width);
        for (size_t p = 0; p + row < truth.size(); ++p) {
            const double slope = std::hypot(truth[p + 1] - truth[p], truth[p + row] - truth[p]);
            const double off = ours.mask[p] & mask_misaligned ? most - least : 0.5 * slope;
            squares += off * off, ++samples;
        }
    }
    return std::sqrt(squares / samples);
}

void expect_finite(const Target& target) {
    const auto is_finite = [](float v) { return std::isfinite(v); };
    for (const auto& lamp : target.lamps) EXPECT_TRUE(std::ranges::all_of(lamp, is_finite));
    for (const FlowField& flow : target.motion.flows)
        EXPECT_TRUE(std::ranges::all_of(flow.u, is_finite) && std::ranges::all_of(flow.v, is_finite));
}

void expect_never_worse(const std::string& name, const Scene& scene) {
    Take take(scene, "single");
    const uint64_t target = take.middle_target();
    const double none = take.error(take.develop("none", target), target);
    for (const char* quality : {"preview", "standard"}) {
        const Target developed = take.develop(quality, target);
        const double ours = take.error(developed, target), bound = none + allowed_beyond_none(take, developed);
        expect_finite(developed);
        EXPECT_LE(ours, bound) << name << ", " << quality;
        // The bound is wide; what comes out is better than none.
        EXPECT_LT(ours, none) << name << ", " << quality;
        if (quality == std::string("standard"))
            record_case(name + ": a target's error, uncompensated or by preset standard", with_unit(none, "r"),
                        with_unit(ours, "r"), with_unit(bound, "r"));
    }
}

Offset jump(double slots) {
    return {slots < 27 ? 0.0 : 60.0, 0};
}

}  // namespace

TEST(NeverWorse, after_a_jump_of_60_pixels) {
    expect_never_worse("a jump of 60 px between tracking frames",
                       {.layers = {{wavy(5, 0.3, 0.1)}, {wavy(2), 25, [](double slots) {
                                                             return Offset{jump(slots).x - 30, 0};
                                                         }}}});
}

TEST(NeverWorse, where_a_subject_enters) {
    expect_never_worse("a subject that enters and leaves within a cycle",
                       {.layers = {{wavy(5, 0.3, 0.1)}, {wavy(2), radius, [](double slots) {
                                                             return Offset{1.6 * slots, 0};
                                                         }}}});
}

TEST(NeverWorse, where_tracking_light_flickers) {
    const auto flicker = [](double slots) { return 0.75 + 0.25 * std::sin(1.9 * slots / 18); };
    expect_never_worse("tracking light that flickers between half and all",
                       {.layers = {{wavy(5, 0.3, 0.1)},
                                   {wavy(2), radius,
                                    [](double slots) {
                                        return Offset{slots / 9, 0};
                                    }}},
                        .flicker = flicker});
}

TEST(NeverWorse, where_tracking_frames_saturate) {
    // Twice as bright as white: half of the disc is saturated in tracking frames, and in no basis frame.
    expect_never_worse("a subject that saturates tracking frames",
                       {.layers = {{even(0.1)}, {wavy(2, 0.9, 0.8), radius, [](double slots) {
                                                     return Offset{slots / 9, 0};
                                                 }}}});
}

TEST(NeverWorse, of_a_black_subject_before_texture) {
    expect_never_worse("a black subject that moves before a textured background",
                       {.layers = {{wavy(5)}, {even(0), radius, [](double slots) {
                                                   return Offset{slots / 9, 0};
                                               }}}});
}

TEST(NeverWorse, of_a_textureless_subject_before_grey) {
    expect_never_worse("a textureless subject that moves before another grey",
                       {.layers = {{even(0.3)}, {even(0.6), radius, [](double slots) {
                                                     return Offset{slots / 9, 0};
                                                 }}}});
}
