// SPDX-License-Identifier: MIT
// Samples at another time's places: against ramps, whose bilinear interpolation is exact, and against the input's own bits.
// links: ols_develop
#include "develop/align.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <type_traits>

#include "demultiplex/masked_sample.hpp"
#include "develop/aligned_rows.hpp"

using namespace ols;

namespace {

constexpr int width = 46, height = 34;  // no multiple of sixteen
constexpr float black_counts = 64.25f;

template <typename Sample>
std::shared_ptr<Frame> frame_of(Cfa cfa, float white, const std::function<double(int, int, int)>& counts) {
    const int channels = samples_per_pixel(cfa);
    auto frame = std::make_shared<Frame>();
    frame->width = width, frame->height = height, frame->cfa = cfa, frame->white = white;
    frame->format = std::is_same_v<Sample, float> ? PixelFormat::f32 : PixelFormat::u16;
    frame->pitch_bytes = uint32_t((width * channels + 5) * int(sizeof(Sample)));
    frame->samples.resize(size_t(frame->pitch_bytes) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            for (int c = 0; c < channels; ++c) {
                const auto sample = Sample(counts(x, y, c));
                const size_t at = size_t(y) * frame->pitch_bytes + size_t(x * channels + c) * sizeof sample;
                std::memcpy(frame->samples.data() + at, &sample, sizeof sample);
            }
    return frame;
}

Image black_of(Cfa cfa) {
    Image black(width, height, samples_per_pixel(cfa));
    std::ranges::fill(black.data, black_counts);
    return black;
}

// Two knots, at ticks 0 (the instant itself) and 100, where the whole image has moved by (u, v).
MotionPath moving(float u, float v) {
    MotionPath path(2);
    for (size_t k = 0; k < 2; ++k) {
        path[k] = {100.0 * double(k), FlowField(width, height), std::vector<float>(size_t(width * height), 1), k == 0};
        std::ranges::fill(path[k].flow.u, k * u);
        std::ranges::fill(path[k].flow.v, k * v);
    }
    return path;
}

// One row of a basis, aligned: [channel][pixel].
template <typename Sample, typename Sum>
std::vector<std::vector<Sum>> aligned(const std::shared_ptr<Frame>& frame, const MotionPath& path, double tick) {
    const Image black = black_of(frame->cfa);
    AlignedRows<Sample, Sum> rows;
    rows.alignment = std::make_shared<Alignment>(path, width, height, frame->cfa, 0.02f, 1);
    const auto dark = black_planes<Sample>(black, frame->cfa, frame->format);
    rows.rows.resize(1);
    rows.rows[0].push_back({.nearer = {std::make_shared<SignalPlanes<Sample>>(signal_planes(*frame, dark, false)),
                                       rows.alignment->place_of(tick)}});
    std::vector<std::vector<Sum>> out;
    for (int channel = 0; channel < samples_per_pixel(frame->cfa); ++channel) {
        const Band band{0, height, width, channel, samples_per_pixel(frame->cfa)};
        const auto loaded = rows.load(band, *frame, black, false);
        out.emplace_back(loaded.row(0), loaded.row(0) + band.samples());
    }
    return out;
}

// Standing still gives what the frame has, less the whole part of black (all of it for floats).
template <typename Stored, typename Sample, typename Sum>
void expect_own_bits(Cfa cfa, float white) {
    std::mt19937 random(3);
    const bool is_float = std::is_same_v<Stored, float>;
    std::vector<double> counts;
    const auto frame = frame_of<Stored>(cfa, white, [&](int, int, int) {
        counts.push_back(double(random() % unsigned(white)) + (is_float ? 0.375 : 0));
        return counts.back();
    });
    const auto out = aligned<Sample, Sum>(frame, moving(0, 0), 40);
    const size_t channels = out.size();
    for (size_t i = 0; i < counts.size(); ++i)
        ASSERT_EQ(double(out[i % channels][i / channels]),
                  is_float ? double(float(counts[i]) - black_counts) : counts[i] - 64);
}

}  // namespace

TEST(Align, standing_still_keeps_every_bit_of_every_kind_of_frame) {
    for (const Cfa cfa : {Cfa::none, Cfa::rggb, Cfa::gbrg, Cfa::rgb}) {
        expect_own_bits<uint16_t, int16_t, int16_t>(cfa, 4095);
        expect_own_bits<uint16_t, float, int32_t>(cfa, 65535);
        expect_own_bits<float, float, float>(cfa, 1e6f);
    }
}

TEST(Align, samples_are_those_of_the_places_they_came_from) {
    const auto frame = frame_of<uint16_t>(Cfa::none, 4095, [](int x, int y, int) { return 500 + 12 * x + 20 * y; });
    for (const float fraction : {0.0f, 0.25f, 0.6f, 1.0f}) {
        const auto out = aligned<int16_t, int16_t>(frame, moving(3.5f, -2), 100 * double(fraction))[0];
        for (int y = 4; y < height - 4; ++y)
            for (int x = 4; x < width - 4; ++x) {
                const double truth = 436 + 12 * (x + 3.5 * fraction) + 20 * (y - 2 * fraction);
                // Rounding to counts, and 2^-12 pixels of 32 counts.
                ASSERT_NEAR(out[size_t(y * width + x)], truth, 0.5 + 0.02) << fraction;
            }
    }
}

TEST(Align, colours_of_a_mosaic_never_mix) {
    // A ramp for each colour, a thousand counts apart: a neighbour's colour would show at once.
    const auto ramp = [](int color, double x, double y) { return 300 + 1000 * color + 6 * x + 4 * y; };
    for (const Cfa cfa : {Cfa::rggb, Cfa::bggr, Cfa::grbg, Cfa::gbrg}) {
        const auto frame =
            frame_of<uint16_t>(cfa, 4095, [&](int x, int y, int) { return ramp(cfa_color(cfa, x, y), x, y); });
        const auto out = aligned<int16_t, int16_t>(frame, moving(3, 1.5f), 70)[0];
        for (int y = 4; y < height - 4; ++y)
            for (int x = 4; x < width - 6; ++x)
                ASSERT_NEAR(out[size_t(y * width + x)], ramp(cfa_color(cfa, x, y), x + 2.1, y + 1.05) - 64, 0.52)
                    << x << " " << y;
    }
}

TEST(Align, what_comes_from_outside_is_the_edges) {
    const auto frame = frame_of<uint16_t>(Cfa::none, 4095, [](int x, int y, int) { return 500 + 10 * x + y; });
    const auto right = aligned<int16_t, int16_t>(frame, moving(7, 0), 100)[0];
    const auto up = aligned<int16_t, int16_t>(frame, moving(0, -9), 100)[0];
    for (int x = 0; x < width; ++x) {
        EXPECT_EQ(right[size_t(5 * width + x)], 500 + 10 * std::min(x + 7, width - 1) + 5 - 64);
        EXPECT_EQ(up[size_t(2 * width + x)], 500 + 10 * x - 64);
    }
}

TEST(Align, a_saturated_sample_masks_what_it_takes_part_in_and_no_more) {
    const auto frame =
        frame_of<uint16_t>(Cfa::none, 4095, [](int x, int y, int) { return x == 20 && y == 10 ? 4095 : 900; });
    const auto out = aligned<int16_t, int16_t>(frame, moving(0.5f, 0), 100)[0];
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            EXPECT_EQ(is_masked(out[size_t(y * width + x)]), y == 10 && (x == 19 || x == 20)) << x << " " << y;
}

TEST(Alignment, finds_the_interval_of_a_tick_and_goes_on_beyond_the_ends) {
    MotionPath path;
    for (const double tick : {0.0, 100.0, 300.0})
        path.push_back({tick, FlowField(width, height), std::vector<float>(size_t(width * height), 1), tick == 100});
    const Alignment alignment(path, width, height, Cfa::none, 0, 1);
    ASSERT_EQ(alignment.intervals(), 2u);
    const auto expect_place = [&](double tick, size_t interval, float fraction) {
        const Alignment::Place place = alignment.place_of(tick);
        EXPECT_EQ(place.interval, interval) << tick;
        EXPECT_FLOAT_EQ(place.fraction, fraction) << tick;
    };
    expect_place(0, 0, 0);
    expect_place(25, 0, 0.25f);
    expect_place(100, 1, 0);
    expect_place(150, 1, 0.25f);
    expect_place(300, 1, 1);
    expect_place(400, 1, 1.5f);
    expect_place(-50, 0, -0.5f);
}

TEST(Alignment, trusts_an_interval_as_far_as_the_worse_of_its_knots) {
    MotionPath path = moving(1, 0);
    path[1].confidence[7] = 0.25f;
    const Alignment alignment(path, width, height, Cfa::none, 0, 1);
    EXPECT_EQ(alignment.confidence(0)[7], 0.25f);
    EXPECT_EQ(alignment.confidence(0)[8], 1);
}

TEST(Alignment, of_a_single_knot_stands_still_and_trusts_nothing) {
    const Alignment alignment({moving(0, 0)[0]}, width, height, Cfa::rggb, 0, 1);
    ASSERT_EQ(alignment.intervals(), 1u);
    EXPECT_EQ(alignment.place_of(1e6).interval, 0u);
    for (const float c : alignment.confidence(0)) EXPECT_EQ(c, 0);
}
