// SPDX-License-Identifier: MIT
// Developing a cycle against the inversion written out in double precision, and what masks and missing slots become.
// links: ols_develop
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "develop/align.hpp"
#include "develop/develop.hpp"

using namespace ols;

namespace {

constexpr int width = 13, height = 11;

struct Cycle {
    Sequence sequence;
    CameraCalibration calibration;
    CycleFrames frames;
};

// Frames of random counts around a black level that is no whole number, with rows padded to a pitch of their own.
template <typename Sample>
Cycle random_cycle(const std::string& basis, Cfa cfa) {
    SequenceConfig config;
    config.basis = basis;
    config.basis_exposure_us = 80;
    Cycle cycle{*compile_sequence(config, default_stage()), {}, {}};
    const int channels = samples_per_pixel(cfa);
    std::mt19937 random(3);
    cycle.calibration.black = Image(width, height, channels);
    cycle.calibration.flat = Image(width, height, channels);
    for (float& black : cycle.calibration.black.data) black = 63.5f + float(random() % 1000) / 1000;
    for (float& flat : cycle.calibration.flat.data) flat = 2 + float(random() % 1000) / 1000;
    for (const Slot& slot : cycle.sequence.slots) {
        auto frame = std::make_shared<Frame>();
        frame->width = width;
        frame->height = height;
        frame->cfa = cfa;
        frame->format = sizeof(Sample) == 2 ? PixelFormat::u16 : PixelFormat::f32;
        frame->pitch_bytes = uint32_t(width * channels * sizeof(Sample) + 6 * sizeof(Sample));
        frame->exposure_ticks = slot.exposure_ticks;
        frame->samples.resize(size_t(frame->pitch_bytes) * height);
        auto* samples = reinterpret_cast<Sample*>(frame->samples.data());
        for (size_t i = 0; i < frame->samples.size() / sizeof(Sample); ++i) samples[i] = Sample(60 + random() % 3000);
        cycle.frames.slots.push_back(frame);
    }
    return cycle;
}

template <typename Sample>
double counts_at(const Frame& frame, int x, int y, int channel) {
    const auto* row = reinterpret_cast<const Sample*>(frame.samples.data() + size_t(y) * frame.pitch_bytes);
    return row[x * samples_per_pixel(frame.cfa) + channel];
}

template <typename Sample>
void expect_inverse(const Cycle& cycle, double tolerance) {
    const auto target = develop_cycle(cycle.frames, cycle.sequence, cycle.calibration, NoiseModel{});
    ASSERT_TRUE(target.ok()) << target.error().message;
    const Basis& basis = cycle.sequence.basis;
    const int planes = target->planes();
    ASSERT_EQ(target->lamps.size(), size_t(basis.lamps * planes));
    for (int lamp = 0; lamp < basis.lamps; lamp += 11)
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int c = 0; c < planes; ++c) {
                    double sum = 0;
                    for (size_t s = 0; s < cycle.sequence.slots.size(); ++s) {
                        const Slot& slot = cycle.sequence.slots[s];
                        if (slot.kind == SlotKind::basis)
                            sum += basis.weight(slot.row, lamp) * (counts_at<Sample>(*cycle.frames.slots[s], x, y, c) -
                                                                   cycle.calibration.black.at(x, y, c));
                    }
                    const double r = basis.scale * sum / (cycle.calibration.flat.at(x, y, c) * 80);
                    ASSERT_NEAR(target->lamps[size_t(lamp * planes + c)][size_t(y * width + x)], r, tolerance);
                }
}

size_t slot_of_row(const Sequence& sequence, int row) {
    size_t s = 0;
    while (sequence.slots[s].row != row) ++s;
    return s;
}

}  // namespace

TEST(Develop, every_basis_is_inverted_exactly_whatever_the_fraction_of_the_black_level) {
    // Float rounding of r around 10.
    for (const char* basis : {"single", "s159", "hadamard156"})
        expect_inverse<uint16_t>(random_cycle<uint16_t>(basis, Cfa::rggb), 1e-5);
}

TEST(Develop, colours_stay_apart_and_floats_are_not_rounded) {
    expect_inverse<uint16_t>(random_cycle<uint16_t>("s159", Cfa::rgb), 1e-5);
    Cycle cycle = random_cycle<float>("s159", Cfa::rgb);
    for (auto& slot : cycle.frames.slots) {
        auto frame = std::make_shared<Frame>(*slot);
        auto* samples = reinterpret_cast<float*>(frame->samples.data());
        for (size_t i = 0; i < frame->samples.size() / sizeof(float); ++i) samples[i] += 0.25f;
        slot = frame;
    }
    expect_inverse<float>(cycle, 1e-5);
}

TEST(Develop, a_saturated_sample_marks_its_pixel_and_no_other) {
    Cycle cycle = random_cycle<uint16_t>("s159", Cfa::rggb);
    auto frame = std::make_shared<Frame>(*cycle.frames.slots[slot_of_row(cycle.sequence, 70)]);
    const uint16_t white = 4095;
    std::memcpy(frame->samples.data() + 4 * frame->pitch_bytes + 9 * 2, &white, 2);
    cycle.frames.slots[slot_of_row(cycle.sequence, 70)] = frame;
    const auto target = develop_cycle(cycle.frames, cycle.sequence, cycle.calibration, NoiseModel{});
    for (int p = 0; p < width * height; ++p)
        EXPECT_EQ(target->mask[size_t(p)], p == 4 * width + 9 ? uint32_t(mask_saturated) : 0u);
}

TEST(Develop, the_variance_is_what_repeated_noise_gives) {
    // Additive noise alone: 2 counts through s159, over many cycles.
    NoiseModel noise{2, 0};
    Cycle cycle = random_cycle<uint16_t>("s159", Cfa::none);
    std::mt19937 random(4);
    std::normal_distribution<double> gauss(0, 2);
    double squares = 0, predicted = 0;
    int samples = 0;
    Target clean = *develop_cycle(cycle.frames, cycle.sequence, cycle.calibration, noise);
    for (int repeat = 0; repeat < 4; ++repeat) {
        Cycle noisy = cycle;
        for (auto& slot : noisy.frames.slots) {
            auto frame = std::make_shared<Frame>(*slot);
            auto* counts = reinterpret_cast<uint16_t*>(frame->samples.data());
            for (size_t i = 0; i < frame->samples.size() / 2; ++i)
                counts[i] = uint16_t(std::lround(counts[i] + gauss(random)));
            slot = frame;
        }
        const Target target = *develop_cycle(noisy.frames, noisy.sequence, noisy.calibration, noise);
        for (size_t lamp = 0; lamp < target.lamps.size(); ++lamp)
            for (size_t p = 0; p < target.variance.size(); ++p) {
                const double error = target.lamps[lamp][p] - clean.lamps[lamp][p];
                squares += error * error;
                predicted += target.variance[p];
                ++samples;
            }
    }
    // Rounding adds 1/12 to the 4 counts squared; 90 000 values, correlated over lamps.
    EXPECT_NEAR(squares / predicted, (4 + 1 / 12.0) / 4, 0.05);
    EXPECT_GT(samples, 80'000);
}

TEST(Develop, a_slot_lost_from_the_single_basis_is_one_missing_lamp) {
    Cycle cycle = random_cycle<uint16_t>("single", Cfa::rggb);
    cycle.frames.slots[slot_of_row(cycle.sequence, 42)] = nullptr;
    const auto target = develop_cycle(cycle.frames, cycle.sequence, cycle.calibration, NoiseModel{});
    ASSERT_TRUE(target.ok());
    EXPECT_EQ(target->missing_lamps, std::vector<int>{42});
    for (const float value : target->lamps[42]) EXPECT_EQ(value, 0);
    for (const uint32_t mask : target->mask) EXPECT_EQ(mask, uint32_t(mask_missing));
}

TEST(Develop, a_slot_that_is_no_basis_slot_may_be_missing) {
    Cycle cycle = random_cycle<uint16_t>("s159", Cfa::rggb);
    for (size_t s = 0; s < cycle.sequence.slots.size(); ++s)
        if (cycle.sequence.slots[s].kind != SlotKind::basis) cycle.frames.slots[s] = nullptr;
    expect_inverse<uint16_t>(cycle, 1e-5);
}

TEST(Align, samples_are_rounded_half_away_from_zero_and_whole_ones_pass) {
    const std::vector<float> samples = {-64, 4031, 0, 2.5f, -2.5f, 2.49f, -2.49f};
    std::vector<int32_t> aligned(samples.size());
    align_samples(samples, aligned);
    EXPECT_EQ(aligned, (std::vector<int32_t>{-64, 4031, 0, 3, -3, 2, -2}));
}
