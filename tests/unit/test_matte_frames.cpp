// SPDX-License-Identifier: MIT
// Which matte frames a target takes, and their mean at its time: against ramps that move evenly, in closed form, and layers whose
// matte is known.
// links: ols_develop
#include "develop/matte_frames.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "../stability/moving_take.hpp"

using namespace ols;
using namespace ols::moving;

namespace {

constexpr int width = 64, height = 12;
constexpr uint64_t target = 180;  // the first tracking slot of the second cycle
constexpr double period_ticks = 57870;

Sequence sequence_of(int cycles = 3) {
    SequenceConfig config;
    config.basis = "s159";
    config.cycles = cycles;
    return *compile_sequence(config, default_stage());
}

std::vector<uint64_t> nearest(const Sequence& sequence, uint64_t number, const std::set<uint64_t>& lost = {}) {
    return nearest_matte_frames(sequence, number, [&](uint64_t n) { return !lost.contains(n); });
}

// Counts above black as a function of the column and of the slots since the target.
using Ramp = std::function<double(double x, double slots)>;

struct Ramps {
    CameraCalibration calibration{Image(width, height, 1), Image(width, height, 1)};
    NoiseModel noise;
    std::vector<MatteFrame> frames;
    std::vector<double> weights;
    double exposure_us = 0;

    Ramps(const std::vector<uint64_t>& numbers, const Ramp& ramp) {
        const Sequence sequence = sequence_of();
        std::ranges::fill(calibration.black.data, 64.25f);
        std::ranges::fill(calibration.flat.data, 2.0f);
        for (const uint64_t number : numbers) {
            const Slot& slot = sequence.slots[number % 180];
            auto frame = std::make_shared<Frame>();
            frame->width = width, frame->height = height, frame->pitch_bytes = width * 2;
            frame->white = 4095;
            frame->tick = number * slot.period_ticks, frame->exposure_ticks = slot.exposure_ticks;
            frame->samples.resize(width * height * 2);
            auto* samples = reinterpret_cast<uint16_t*>(frame->samples.data());
            const double slots = (double(frame->tick) + 0.5 * frame->exposure_ticks) / period_ticks - double(target);
            for (int p = 0; p < width * height; ++p)
                samples[p] = uint16_t(std::min(std::lround(64.25 + ramp(p % width, slots)), 4095L));
            exposure_us = frame->exposure_ticks / double(ticks_per_us);
            frames.push_back({number, frame});
        }
        weights = matte_weights(frames, target, sequence);
    }

    // With a subject that has moved `px_a_slot` per slot since the target, and confidences before and after it.
    TargetMatte mean(double px_a_slot, float before = 1, float after = 1) const {
        MotionPath path;
        for (const double slots : {-100.0, 0.0, 100.0}) {
            MotionKnot knot{(double(target) + slots) * period_ticks, FlowField(width, height), {}, slots == 0};
            std::ranges::fill(knot.flow.u, float(px_a_slot * slots));
            knot.confidence.assign(knot.flow.size(), slots < 0 ? before : slots > 0 ? after : 1.0f);
            path.push_back(std::move(knot));
        }
        const auto alignment = std::make_shared<Alignment>(path, width, height, Cfa::none, 0.02f, 1);
        return mean_matte({frames, weights, alignment, calibration, noise, 1});
    }

    double counts(const TargetMatte& matte, int x) const {
        return matte.planes[0][size_t(3 * width + x)] * 2.0 * exposure_us;
    }
};

const std::vector<uint64_t> ten = {91, 109, 127, 145, 163, 181, 199, 217, 235, 253};

}  // namespace

TEST(MatteFrames, nearest_to_a_target_are_ten_about_it_and_the_next_ones_for_those_that_are_lost) {
    const Sequence sequence = sequence_of();
    ASSERT_EQ(sequence.slots.size(), 180u);
    EXPECT_EQ(nearest(sequence, target), ten);
    EXPECT_EQ(nearest(sequence, target, {181, 163}),
              (std::vector<uint64_t>{73, 91, 109, 127, 145, 199, 217, 235, 253, 271}));
    EXPECT_EQ(nearest(sequence, 0), (std::vector<uint64_t>{1, 19, 37, 55, 73, 91, 109, 127, 145, 163}));
    std::set<uint64_t> most;
    for (uint64_t number = 1; number < 540; number += 18)
        if (number != 109 && number != 343) most.insert(number);
    EXPECT_EQ(nearest(sequence, target, most), (std::vector<uint64_t>{109, 343}));
    most.insert({109, 343});
    EXPECT_TRUE(nearest(sequence, target, most).empty());
}

TEST(MatteFrames, weigh_less_the_farther_they_are_and_never_nothing) {
    const std::vector<MatteFrame> frames = {{91, {}}, {163, {}}, {181, {}}};
    const std::vector<double> weights = matte_weights(frames, target, sequence_of());
    // 89, 17 and 1 slots of 89 + 18.
    EXPECT_DOUBLE_EQ(weights[0], 18 / 107.0);
    EXPECT_DOUBLE_EQ(weights[1], 90 / 107.0);
    EXPECT_DOUBLE_EQ(weights[2], 106 / 107.0);
}

// A ramp is the same under bilinear interpolation: what is left is the rounding of the frames and of the warped counts, half a
// count each, and of the ramp where it is interpolated.
TEST(MatteFrames, of_a_moving_ramp_give_the_ramp_at_the_targets_time) {
    constexpr double px_a_slot = 0.07, counts_a_px = 30;
    const Ramp ramp = [](double x, double slots) { return 200 + counts_a_px * (x - px_a_slot * slots); };
    const std::vector<uint64_t> numbers(ten.begin() + 3, ten.end());  // more after than before
    const Ramps ramps(numbers, ramp);
    const TargetMatte aligned = ramps.mean(px_a_slot), still = ramps.mean(0);
    EXPECT_EQ(aligned.frames, 7);
    double mean_shift = 0, sum = 0;
    for (size_t i = 0; i < numbers.size(); ++i) {
        const Frame& frame = *ramps.frames[i].frame;
        const double slots = (double(frame.tick) + 0.5 * frame.exposure_ticks) / period_ticks - double(target);
        mean_shift += ramps.weights[i] * slots * px_a_slot, sum += ramps.weights[i];
    }
    mean_shift /= sum;
    EXPECT_GT(counts_a_px * mean_shift, 15);  // what the mean is off by without alignment
    for (int x = 10; x < width - 10; ++x) {
        EXPECT_NEAR(ramps.counts(aligned, x), ramp(x, 0), 1) << x;
        EXPECT_NEAR(ramps.counts(still, x), ramp(x - mean_shift, 0), 0.5) << x;
    }
}

TEST(MatteFrames, that_are_not_trusted_count_only_where_no_other_is_left) {
    const Ramps ramps(ten, [](double, double slots) { return slots < 0 ? 1000.0 : 500.0; });
    EXPECT_NEAR(ramps.counts(ramps.mean(0, 1, 0), 20), 1000, 0.5);
    EXPECT_NEAR(ramps.counts(ramps.mean(0, 0, 1), 20), 500, 0.5);
    const double before = std::accumulate(ramps.weights.begin(), ramps.weights.begin() + 5, 0.0),
                 all = std::accumulate(ramps.weights.begin(), ramps.weights.end(), 0.0);
    const double mean = (1000 * before + 500 * (all - before)) / all;
    EXPECT_NEAR(ramps.counts(ramps.mean(0, 0, 0), 20), mean, 0.5);
    EXPECT_NEAR(ramps.counts(ramps.mean(0, 1, 1), 20), mean, 0.5);
}

TEST(MatteFrames, that_are_saturated_count_only_where_all_are) {
    const Ramps ramps(ten, [](double x, double slots) { return x == 30 || (x == 40 && slots < 0) ? 9000.0 : 700.0; });
    const TargetMatte matte = ramps.mean(0);
    EXPECT_NEAR(ramps.counts(matte, 20), 700, 0.5);
    EXPECT_NEAR(ramps.counts(matte, 40), 700, 0.5);
    EXPECT_NEAR(ramps.counts(matte, 30), 4095 - 64.25, 0.5);
}

TEST(MatteFrames, have_the_variance_of_a_weighted_mean) {
    const Ramps ramps(ten, [](double, double) { return 900.0; });
    double squares = 0, sum = 0;
    for (const double weight : ramps.weights) squares += weight * weight, sum += weight;
    const double sigma = 2.68 + 0.492 * std::sqrt(900), scale = 2.0 * ramps.exposure_us;
    EXPECT_NEAR(ramps.mean(0).variance[100] * scale * scale / (sigma * sigma * squares / (sum * sum)), 1, 1e-3);
}

namespace {

// A dark disc that moves before an even board, which its lamps light.
Scene before_the_board(int wide = 56, int high = 44) {
    Layer board{even(1)}, subject{wavy(3), high / 3.0, [](double slots) { return Offset{20 * slots / 180, 0}; }};
    board.board = 0.8, subject.board = 0.02;
    board.normal = {0, 0, -1};  // the sphere's lamps do not light it
    return {.layers = {board, subject}, .width = wide, .height = high, .is_noisy = false};
}

double error(const TargetMatte& matte, const std::vector<double>& truth) {
    double squares = 0;
    for (size_t p = 0; p < truth.size(); ++p) squares += std::pow(double(matte.planes[0][p]) - truth[p], 2);
    return std::sqrt(squares / double(truth.size()));
}

}  // namespace

TEST(MatteFrames, of_a_performance_are_brought_to_the_targets_time) {
    Take take(before_the_board(80, 64), "single");
    const uint64_t number = take.middle_target();
    const std::vector<double> truth = take.matte_truth(number);
    const TargetMatte none = take.develop("none", number).matte;
    EXPECT_EQ(none.frames, 10);
    for (const char* quality : {"preview", "standard"}) {
        const Target aligned = take.develop(quality, number);
        EXPECT_LT(error(aligned.matte, truth), 0.6 * error(none, truth)) << quality;
        EXPECT_EQ(aligned.matte.variance.size(), truth.size());
    }
}

TEST(MatteFrames, without_compensation_are_a_plain_weighted_mean) {
    Take take(before_the_board(), "single", {163, 199});
    const uint64_t number = take.middle_target();
    const TargetFrames frames = take.around(number);
    const TargetMatte matte = take.develop("none", number).matte;
    ASSERT_EQ(frames.matte.size(), 10u);
    EXPECT_EQ(matte.frames, 10);
    const std::vector<double> weights = matte_weights(frames.matte, number, take.sequence());
    const double exposure_us = frames.matte[0].frame->exposure_ticks / double(ticks_per_us);
    for (size_t p = 0; p < matte.planes[0].size(); ++p) {
        double counts = 0, sum = 0;
        for (size_t i = 0; i < weights.size(); ++i) {
            const auto* samples = reinterpret_cast<const uint16_t*>(frames.matte[i].frame->samples.data());
            counts += weights[i] * (samples[p] - double(black_counts)), sum += weights[i];
        }
        ASSERT_NEAR(matte.planes[0][p], counts / sum / counts_per_us / exposure_us, 1e-6);
    }
}

TEST(MatteFrames, of_a_target_are_none_where_all_are_lost_and_the_lamps_are_the_same) {
    std::set<uint64_t> lost;
    for (uint64_t number = 1; number < 540; number += 18) lost.insert(number);
    Take take(before_the_board(), "single"), without(before_the_board(), "single", lost);
    const Target target = without.develop("preview", take.middle_target());
    EXPECT_EQ(target.matte.frames, 0);
    EXPECT_TRUE(target.matte.planes.empty());
    EXPECT_EQ(target.lamps, take.develop("preview", take.middle_target()).lamps);
}

TEST(MatteFrames, give_the_same_bits_on_one_thread_and_on_two) {
    Take take(before_the_board(), "single");
    const TargetMatte one = take.develop("preview", take.middle_target(), {Estimate::none, {}, 1}).matte,
                      two = take.develop("preview", take.middle_target(), {Estimate::none, {}, 2}).matte;
    EXPECT_EQ(one.planes, two.planes);
    EXPECT_EQ(one.variance, two.variance);
}
