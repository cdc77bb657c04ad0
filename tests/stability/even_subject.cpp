// SPDX-License-Identifier: MIT
// Subjects that show nothing above the camera's noise, black or textureless: flow that reads the noise carries them about.
// links: ols_develop
#include "develop/tracking_image.hpp"
#include "hard_case.hpp"
#include "moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

struct Longest {
    double untold = 0, told = 0;  // of the noise; pixels
};

// The longest vector from the middle target to the tracking frames of half a cycle around it.
Longest longest_vectors(Take& take, const std::string& quality) {
    const TrackingFlowOptions options = motion_quality(quality)->flow;
    TrackingFlows untold(options), told(options);
    const uint64_t target = take.middle_target();
    const CameraCalibration& calibration = take.calibration();
    for (uint64_t number = target - 90; number <= target + 90; number += 18) {
        const Frame& frame = *take.frame(number);
        const Image image = tracking_image(frame, calibration.black, calibration.flat);
        const Image noise = tracking_noise(frame, calibration.black, calibration.flat, {});
        EXPECT_TRUE(untold.add(take.time_of(number), image).ok());
        EXPECT_TRUE(told.add(take.time_of(number), image, noise).ok());
    }
    const auto longest = [&](TrackingFlows& flows) {
        double most = 0;
        const double instant = take.time_of(target);
        const MotionPath path = *flows.path(instant, instant - 90, instant + 90);
        for (const MotionKnot& knot : path)
            for (size_t p = 0; p < knot.flow.size(); ++p)
                most = std::max(most, std::hypot(double(knot.flow.u[p]), double(knot.flow.v[p])));
        return most;
    };
    return {longest(untold), longest(told)};
}

}  // namespace

// Bound: 0. Nothing shows above the noise anywhere, so that no pixel of either image says anything.
TEST(EvenSubject, without_anything_to_see_stands_still) {
    for (const auto& [name, albedo] : {std::pair("black", 0.0), std::pair("textureless", 0.4)})
        for (const char* quality : {"preview", "standard"}) {
            Take take({.layers = {{even(albedo)}}}, "single");
            const Longest longest = longest_vectors(take, quality);
            EXPECT_EQ(longest.told, 0) << name << ", " << quality;
            EXPECT_GT(longest.untold, 1) << name << ", " << quality;
        }
    Take take({.layers = {{even(0)}}}, "single");
    const Longest longest = longest_vectors(take, "standard");
    expect_within("a black subject that stands still, flow told of the noise or not: its longest vector",
                  longest.untold, longest.told, 0, "px");
}

// What no compensation gives, to the bit, as nothing moves.
TEST(EvenSubject, that_is_black_comes_out_as_without_compensation) {
    Take take({.layers = {{even(0)}}}, "s159");
    const uint64_t target = take.middle_target();
    const Target none = take.develop("none", target);
    size_t changed = 0;
    for (const char* quality : {"preview", "standard", "final"}) {
        const Target ours = take.develop(quality, target);
        for (size_t lamp = 0; lamp < none.lamps.size(); ++lamp)
            for (size_t p = 0; p < none.mask.size(); ++p) changed += ours.lamps[lamp][p] != none.lamps[lamp][p];
        for (const uint32_t mask : ours.mask) EXPECT_FALSE(mask & mask_misaligned) << quality;
    }
    EXPECT_EQ(changed, 0u);
}

// Along its slope a step of height h, seen through a Gaussian of s pixels, is found to within sigma / (h sqrt(n)) of
// 2 s sqrt(pi), n the pixels along it that move together; with h / sigma = 60 and ten of them, 0.04 pixels. Twice that may be.
TEST(EvenSubject, before_black_stands_still_by_its_outline) {
    Take take({.layers = {{even(0)}, {even(0.5), 35}}}, "single");
    EXPECT_LT(longest_vectors(take, "standard").told, 2 * 2 * 2 * std::sqrt(M_PI) / (60 * std::sqrt(10.0)));
}
