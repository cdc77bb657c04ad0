// SPDX-License-Identifier: MIT
// Samples above black, masks and margins, each by definition.
// links: ols_develop
#include "develop/signal_planes.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "demultiplex/masked_sample.hpp"

using namespace ols;

namespace {

Frame frame_of(int width, int height, Cfa cfa, float white, const std::vector<uint16_t>& counts) {
    Frame frame;
    frame.width = uint32_t(width), frame.height = uint32_t(height), frame.cfa = cfa, frame.white = white;
    frame.pitch_bytes = uint32_t(width * samples_per_pixel(cfa) * 2);
    frame.samples.resize(counts.size() * 2);
    std::memcpy(frame.samples.data(), counts.data(), frame.samples.size());
    return frame;
}

Image even_black(int width, int height, Cfa cfa, float level) {
    Image black(width, height, samples_per_pixel(cfa));
    std::ranges::fill(black.data, level);
    return black;
}

SignalPlanes<int16_t> planes_of(const Frame& frame, float level) {
    const Image black = even_black(int(frame.width), int(frame.height), frame.cfa, level);
    return signal_planes(frame, black_planes<int16_t>(black, frame.cfa, PixelFormat::u16), true);
}

}  // namespace

// A sensor of 14 bits in 16 may deliver anything above its white.
TEST(SignalPlanes, counts_beyond_white_are_masked_and_clipped_however_large) {
    const auto planes = planes_of(frame_of(4, 1, Cfa::none, 16000, {100, 16000, 33000, 65535}), 64.25f);
    const int16_t* const seen = planes.channels[0].row(0);
    EXPECT_EQ(seen[0], 36);
    for (const int x : {1, 2, 3}) EXPECT_TRUE(is_masked(seen[x])) << x;
    ASSERT_TRUE(planes.any_masked);
    const int16_t* const clipped = planes.clipped[0].row(0);
    EXPECT_EQ(clipped[0], 36);
    for (const int x : {1, 2, 3}) EXPECT_EQ(clipped[x], 16000 - 64) << x;
}

TEST(SignalPlanes, of_a_frame_that_saturates_nowhere_are_not_made_twice) {
    const auto planes = planes_of(frame_of(3, 1, Cfa::none, 4095, {0, 64, 4094}), 64);
    EXPECT_FALSE(planes.any_masked);
    EXPECT_TRUE(planes.clipped.empty());
}

TEST(SignalPlanes, of_16_bits_up_to_their_last_count_are_seen) {
    const auto frame = frame_of(3, 1, Cfa::none, 65536, {0, 65534, 65535});
    const Image black = even_black(3, 1, Cfa::none, 64);
    const auto planes = signal_planes(frame, black_planes<float>(black, Cfa::none, PixelFormat::u16), false);
    EXPECT_FALSE(planes.any_masked);
    EXPECT_EQ(planes.channels[0].row(0)[2], 65535 - 64);
    Frame saturating = frame;
    saturating.white = 65535;
    const auto less = signal_planes(saturating, black_planes<float>(black, Cfa::none, PixelFormat::u16), false);
    EXPECT_TRUE(less.any_masked);
    EXPECT_EQ(less.channels[0].row(0)[1], 65534 - 64);
    EXPECT_TRUE(is_masked(less.channels[0].row(0)[2]));
}

TEST(SignalPlanes, channels_of_rgb_lie_apart) {
    const auto planes = planes_of(frame_of(2, 1, Cfa::rgb, 4095, {101, 102, 103, 201, 202, 203}), 1);
    ASSERT_EQ(planes.channels.size(), 3u);
    for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(planes.channels[size_t(c)].row(0)[0], 100 + c);
        EXPECT_EQ(planes.channels[size_t(c)].row(0)[1], 200 + c);
    }
}

// Beyond an edge lies the nearest sample of the same colour.
TEST(SignalPlanes, margins_repeat_each_colors_own_edge) {
    for (const Cfa cfa : {Cfa::none, Cfa::rggb})
        for (const auto& [width, height] : {std::pair{6, 4}, {7, 5}, {3, 2}}) {
            std::vector<uint16_t> counts;
            for (int p = 0; p < width * height; ++p) counts.push_back(uint16_t(1000 + p));
            const auto planes = planes_of(frame_of(width, height, cfa, 4095, counts), 0);
            const auto& plane = planes.channels[0];
            const int step = cfa == Cfa::none ? 1 : 2, margin = plane.margin;
            const auto held = [&](int at, int size) {
                while (at < 0) at += step;
                while (at >= size) at -= step;
                return at;
            };
            for (int y = -margin; y < height + margin; ++y)
                for (int x = -margin; x < width + margin; ++x)
                    ASSERT_EQ(plane.row(y)[x], 1000 + held(y, height) * width + held(x, width)) << x << " " << y;
        }
}
