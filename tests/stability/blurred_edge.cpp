// SPDX-License-Identifier: MIT
// Edges of what moves: drawing lines along the flow, the usual way, mixes both sides of an edge and leaves the subject
// where it was uncovered; gathering along a pixel's own flow does not blur over what stands still.
// links: ols_relight
#include <algorithm>
#include <cmath>

#include "hard_case.hpp"
#include "relight/motion_blur.hpp"

using namespace ols;

namespace {

constexpr int width = 80, height = 5, first = 30, last = 49;  // a bright bar of 20 pixels before black
constexpr double fps = 24, length_px = 16;                    // of its way while the shutter is open

Image bar() {
    Image image(width, height, 1);
    for (int y = 0; y < height; ++y)
        for (int x = first; x <= last; ++x) image.at(x, y) = 1;
    return image;
}

TargetMotion bar_moves() {
    TargetMotion motion{{-0.5 / fps, 0.5 / fps}, {FlowField(width, height), FlowField(width, height)}};
    for (int y = 0; y < height; ++y)
        for (int x = first; x <= last; ++x)
            for (size_t k = 0; k < 2; ++k)
                motion.flows[k].u[size_t(y * width + x)] = float(k == 0 ? -length_px / 2 : length_px / 2);
    return motion;
}

// The part of the time that the bar, which ends half a pixel beyond its outermost pixels, covers a pixel's centre.
double covered(int x) {
    const double from = std::max(x - last - 0.5, -length_px / 2), to = std::min(x - first + 0.5, length_px / 2);
    return std::max(0.0, to - from) / length_px;
}

// Each pixel's light is spread over its path, anti-aliased, and every pixel divided by what it got.
double drawn(int at) {
    constexpr int samples = 1000;
    double sum = 0, weights = 0;
    for (int x = 0; x < width; ++x)
        for (int n = 0; n < samples; ++n) {
            const bool moves = x >= first && x <= last;
            const double place = moves ? x + ((n + 0.5) / samples - 0.5) * length_px : x;
            const double weight = std::max(0.0, 1 - std::abs(place - at));
            sum += moves ? weight : 0;
            weights += weight;
        }
    return weights > 0 ? sum / weights : 0;
}

// The mean along the pixel's own path.
double gathered(int at) {
    return at >= first && at <= last
               ? std::clamp((length_px / 2 + std::min(at - first, last - at) + 0.5) / length_px, 0.0, 1.0)
               : 0;
}

template <typename Method>
double worst_error(Method method) {
    double worst = 0;
    for (int x = 0; x < width; ++x) worst = std::max(worst, std::abs(method(x) - covered(x)));
    return worst;
}

// With n sub-frames an edge passes a pixel within half a sub-frame of its time, 1 / (2 n), and two edges pass; before the
// bar has moved by the pixel beyond which the sheet is cut, to either side, its edge is a slope instead: 2 pixels of the way.
double bound(int sub_frames) {
    return 1.0 / sub_frames + 2 / length_px;
}

double ours(int x) {
    static const Image image = motion_blurred(bar(), bar_moves(), fps, {.shutter_deg = 360})->image;
    return double(image.at(x, 2));
}

}  // namespace

TEST(BlurredEdge, against_lines_drawn_along_the_flow) {
    expect_within("blur of a bright bar before black, against lines drawn along the flow", worst_error(drawn),
                  worst_error(ours), bound(16), "of white");
}

TEST(BlurredEdge, against_gathering_along_each_pixels_own_flow) {
    expect_within("blur of a bright bar before black, against gathering along each pixel's own flow",
                  worst_error(gathered), worst_error(ours), bound(16), "of white");
}
