// SPDX-License-Identifier: MIT
// Even surroundings of a moving subject: flow there is anything, which harms nobody; but a subject that covers what is as
// bright as itself must not pass for it.
// links: ols_develop
#include "develop/tracking_image.hpp"
#include "hard_case.hpp"
#include "moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr int width = 160, height = 120;

double distance_from_centre(size_t pixel) {
    return std::hypot(double(pixel % width) - 79.5, double(pixel / width) - 59.5);
}

FlowField disc_moves(double radius, double centre_x, double px) {
    FlowField flow(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            if (std::hypot(x - centre_x, y - 59.5) < radius) flow.u[size_t(y * width + x)] = float(px);
    return flow;
}

}  // namespace

// Bound: what may be called misaligned is where the disc's outline passes while frames are taken, half a cycle's motion (10 px
// and 3 down) to either side of it, and as far beyond as its slope shows above black's noise through the Gaussian of two pixels:
// d with 2000 / (2 sqrt(2 pi)) exp(-d^2 / 8) = 6 * 2.68 / (4 sqrt(8 pi)), 7 px.
TEST(DarkBackground, is_not_called_misaligned) {
    constexpr double radius = 35, moved = 10.5, shows = 7;
    Take take({.layers = {{even(0)},
                          {wavy(2), radius,
                           [](double slots) {
                               return Offset{slots / 9, slots / 30};
                           }}}},
              "single");
    const uint64_t target = take.middle_target();
    size_t beyond = 0, all = 0, plainly = 0;
    const Target ours = take.develop("standard", target);
    // The flow at the knots beside the target, both ways, by forward and backward alone.
    const Image black = take.calibration().black, flat = take.calibration().flat;
    TrackingFlows untold(motion_quality("standard")->flow);
    for (uint64_t number = target - 90; number <= target + 90; number += 18)
        EXPECT_TRUE(untold.add(take.time_of(number), tracking_image(*take.frame(number), black, flat)).ok());
    const double instant = take.time_of(target);
    const MotionPath path = *untold.path(instant, instant - 90, instant + 90);
    for (size_t p = 0; p < ours.mask.size(); ++p) {
        if (distance_from_centre(p) < radius + moved + shows) continue;
        ++all;
        beyond += (ours.mask[p] & mask_misaligned) != 0;
        plainly +=
            std::ranges::any_of(path, [&](const MotionKnot& knot) { return knot.confidence[p] < trusted_confidence; });
    }
    expect_within(
        "a disc moving before black: what is called misaligned of the black that it leaves alone, by forward-backward "
        "or with the noise known",
        100 * double(plainly) / double(all), 100 * double(beyond) / double(all), 0, "%");
}

// Bound: 0, see evenness.hpp: the lesser reach of a covered pixel is half of what it misses itself by. The disc is as bright
// as what it covers; only its outline, three pixels of a darker ring, tells them apart.
TEST(DarkBackground, that_a_subject_as_bright_covers_is_not_trusted) {
    constexpr double radius = 30, moves = 12;
    const Albedo ringed = [](double x, double y) { return std::hypot(x, y) > radius - 3 ? 0.2 : 0.5; };
    Scene scene{.layers = {{even(0.5)}, {ringed, radius, [](double slots) { return Offset{moves * slots, 0}; }}}};
    Take take(scene, "single");
    const std::vector<Image> before = seen_layers(scene, 0), after = seen_layers(scene, 1);
    Image sigma(width, height, 1), from(width, height, 1), to = from;
    std::ranges::fill(sigma.data, 0.005f);
    for (size_t p = 0; p < from.data.size(); ++p) {
        from.data[p] = before[0].data[p] + before[1].data[p];
        to.data[p] = after[0].data[p] + after[1].data[p];
    }
    const FlowField forward = disc_moves(radius, 79.5, moves), backward = disc_moves(radius, 79.5 + moves, -moves);
    const std::vector<float> trust = confidence(forward, backward, evenness_of(from, sigma), evenness_of(to, sigma));
    size_t covered = 0, by_brightness = 0, trusted = 0, harmless = 0;
    for (size_t p = 0; p < trust.size(); ++p) {
        const double x = double(p % width) - 79.5, y = double(p / width) - 59.5;
        if (std::hypot(x, y) > radius + 20) harmless += trust[p] >= trusted_confidence;
        if (std::hypot(x, y) <= radius + 1 || std::hypot(x - moves, y) >= radius - 1) continue;
        ++covered;
        by_brightness += std::abs(from.data[p] - to.data[p]) < 0.01f;
        trusted += trust[p] >= trusted_confidence;
    }
    ASSERT_GT(covered, 100u);
    EXPECT_GT(harmless, 1000u);
    expect_within("a disc covers a background as bright: pixels trusted, by equal brightness or by evenness",
                  double(by_brightness), double(trusted), 0, "pixels");
}
