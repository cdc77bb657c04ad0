// SPDX-License-Identifier: MIT
// Lost slots and saturated samples through the development of a cycle: the error of simulated takes against generalised
// least squares on what is left, written out with Eigen, and what the target says of it.
// links: ols_develop
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "develop/develop.hpp"

using namespace ols;

namespace {

constexpr int width = 64, height = 40, pixels = width * height;
constexpr float black = 64.25f;  // not whole, as measured ones are
const NoiseModel noise;          // the paper's

// A virtual take of one pixel's reflectance function, the same all over the frame so that thousands of samples share one
// prediction: lamps of a cosine lobe and a highlight, in counts.
struct Scene {
    Sequence sequence;
    CameraCalibration calibration;
    Eigen::VectorXd truth;
    Eigen::MatrixXd light;  // rows x images
    std::mt19937 random{5};

    explicit Scene(const std::string& basis) {
        SequenceConfig config;
        config.basis = basis;
        config.basis_exposure_us = 100;
        sequence = *compile_sequence(config, default_stage());
        calibration.black = calibration.flat = Image(width, height, 1);
        std::fill_n(calibration.black.data.begin(), pixels, black);
        std::fill_n(calibration.flat.data.begin(), pixels, 0.01f);  // gain 1: r in counts
        const auto lights = image_lights(sequence.basis, default_stage().lamps);
        truth.resize(Eigen::Index(lights.size()));
        const Vec3 normal = normalized({0.3, 0.4, 0.8}), mirror = normalized({0.5, 0.7, 0.4});
        for (Eigen::Index i = 0; i < truth.size(); ++i) {
            const Vec3 d = lights[size_t(i)].direction;
            truth(i) = 25 * std::max(0.0, dot(normal, d)) + 40 * std::pow(std::max(0.0, dot(mirror, d)), 30);
        }
        light.resize(sequence.basis.rows, truth.size());
        for (int r = 0; r < light.rows(); ++r)
            for (int i = 0; i < light.cols(); ++i) light(r, i) = sequence.basis.light(r, i);
    }

    double sigma(double mean) const { return noise.read_counts + noise.shot * std::sqrt(mean); }

    std::shared_ptr<Frame> expose(double mean) {
        auto frame = std::make_shared<Frame>();
        frame->width = width, frame->height = height;
        frame->pitch_bytes = width * sizeof(uint16_t);
        frame->exposure_ticks = uint32_t(100 * ticks_per_us);
        frame->samples.resize(size_t(pixels) * sizeof(uint16_t));
        auto* samples = reinterpret_cast<uint16_t*>(frame->samples.data());
        std::normal_distribution<double> gauss(mean + black, sigma(mean));
        for (int p = 0; p < pixels; ++p) samples[p] = uint16_t(std::clamp(std::lround(gauss(random)), 0L, 4095L));
        return frame;
    }
    std::shared_ptr<Frame> expose_row(int row) { return expose(light.row(row).dot(truth)); }

    CycleFrames record() {
        CycleFrames frames;
        for (const Slot& slot : sequence.slots)
            frames.slots.push_back(slot.kind == SlotKind::basis ? expose_row(slot.row) : expose(0));
        return frames;
    }

    size_t slot_of(int row) const {
        size_t s = 0;
        while (sequence.slots[s].row != row) ++s;
        return s;
    }

    // Root mean square error over lamps and pixels.
    double error_of(const Target& target) const {
        double squares = 0;
        for (Eigen::Index i = 0; i < truth.size(); ++i)
            for (const float value : target.lamps[size_t(i)]) squares += (value - truth(i)) * (value - truth(i));
        return std::sqrt(squares / double(truth.size() * pixels));
    }

    // What generalised least squares leaves when row r was recorded times[r] times (Aitken 1935): the mean over images of
    // the diagonal of (P' Sigma^-1 P)^-1; rounding to counts adds 1/12 to a frame's variance.
    double prediction(const std::vector<int>& times) const {
        Eigen::VectorXd precision(light.rows());
        for (int r = 0; r < light.rows(); ++r) {
            const double deviation = sigma(light.row(r).dot(truth));
            precision(r) = times[size_t(r)] / (deviation * deviation + 1 / 12.0);
        }
        const Eigen::MatrixXd information = light.transpose() * precision.asDiagonal() * light;
        return std::sqrt(information.inverse().trace() / double(truth.size()));
    }

    std::vector<int> once() const { return std::vector<int>(size_t(sequence.basis.rows), 1); }
};

uint32_t mask_everywhere(const Target& target) {
    uint32_t all = ~0u, any = 0;
    for (const uint32_t bits : target.mask) all &= bits, any |= bits;
    EXPECT_EQ(all, any);
    return any;
}

double mean_variance(const Target& target) {
    double sum = 0;
    for (const float variance : target.variance) sum += variance;
    return sum / double(target.variance.size());
}

// Lamps of a pixel, its masked rows as the least squares of the others foretell them; zero where these do not determine that.
Eigen::VectorXd completed(const Scene& scene, const CycleFrames& frames, size_t pixel, const std::vector<int>& masked) {
    Eigen::VectorXd counts(scene.light.rows());
    std::vector<int> rest;
    Eigen::MatrixXd inverse(scene.light.cols(), scene.light.rows());
    for (int r = 0; r < int(scene.light.rows()); ++r) {
        const Frame& frame = *frames.slots[scene.slot_of(r)];
        counts(r) = reinterpret_cast<const uint16_t*>(frame.samples.data())[pixel] - double(black);
        if (!std::ranges::count(masked, r)) rest.push_back(r);
        for (int i = 0; i < int(scene.light.cols()); ++i) inverse(i, r) = scene.sequence.basis.inverse(r, i);
    }
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(Eigen::MatrixXd(scene.light(rest, Eigen::all)));
    if (solver.rank() < scene.light.cols()) return Eigen::VectorXd::Zero(scene.light.cols());
    counts(masked) = (scene.light * solver.solve(Eigen::VectorXd(counts(rest))))(masked).eval();
    return inverse * counts;
}

}  // namespace

TEST(DevelopMasks, a_lost_slot_of_s159_costs_the_noise_that_least_squares_foretells) {
    Scene scene("s159");
    CycleFrames frames = scene.record();
    auto times = scene.once();
    for (const int row : {5, 6}) {  // one lost, then two
        frames.slots[scene.slot_of(row)] = nullptr;
        times[size_t(row)] = 0;
        const auto target = develop_cycle(frames, scene.sequence, scene.calibration, noise);
        ASSERT_TRUE(target.ok()) << target.error().message;
        const double foretold = scene.prediction(times);
        EXPECT_NEAR(scene.error_of(*target) / foretold, 1, 0.1);
        EXPECT_NEAR(std::sqrt(mean_variance(*target)) / foretold, 1, 0.1);
        const double whole = scene.prediction(scene.once());
        EXPECT_NEAR(target->noise_gain[0] / (foretold * foretold / whole / whole), 1, 0.05);
        EXPECT_EQ(mask_everywhere(*target), uint32_t(mask_missing));
    }
}

TEST(DevelopMasks, five_lost_slots_from_the_neighbouring_cycles_are_as_good_as_recorded) {
    for (const char* basis : {"s159", "hadamard156"}) {
        Scene scene(basis);
        CycleFrames frames = scene.record();
        frames.neighbours.resize(frames.slots.size());
        auto times = scene.once();
        for (const int row : {3, 40, 41, 90, 155}) {
            const size_t slot = scene.slot_of(row);
            frames.slots[slot] = nullptr;
            frames.neighbours[slot] = {scene.expose_row(row), scene.expose_row(row)};  // before and after
            times[size_t(row)] = 2;
        }
        frames.neighbours[scene.slot_of(90)].pop_back();  // lost there too
        times[90] = 1;
        const auto target = develop_cycle(frames, scene.sequence, scene.calibration, noise);
        ASSERT_TRUE(target.ok()) << target.error().message;
        EXPECT_NEAR(scene.error_of(*target) / scene.prediction(times), 1, 0.1) << basis;
        EXPECT_TRUE(target->noise_gain.empty());  // nothing had to be filled in
    }
}

TEST(DevelopMasks, a_row_that_is_recorded_twice_averages_and_spares_a_lost_slot) {
    Scene scene("hadamard156");
    auto times = scene.once();
    // Spare dark places of the cycle show rows again.
    int row = 30;
    for (Slot& slot : scene.sequence.slots)
        if (slot.kind == SlotKind::dark && row < 33) {
            slot.kind = SlotKind::basis;
            slot.row = row;
            times[size_t(row++)] = 2;
        }
    CycleFrames frames = scene.record();
    auto target = develop_cycle(frames, scene.sequence, scene.calibration, noise);
    EXPECT_NEAR(scene.error_of(*target) / scene.prediction(times), 1, 0.1);
    frames.slots[scene.slot_of(31)] = nullptr;
    times[31] = 1;
    target = develop_cycle(frames, scene.sequence, scene.calibration, noise);
    ASSERT_TRUE(target.ok());
    EXPECT_NEAR(scene.error_of(*target) / scene.prediction(times), 1, 0.1);
}

TEST(DevelopMasks, samples_masked_here_and_there_follow_from_their_own_rows_and_leave_the_others_to_the_bit) {
    Scene scene("s159");
    const CycleFrames whole = scene.record();
    const Target unmasked = *develop_cycle(whole, scene.sequence, scene.calibration, noise);
    // Alone, neighbours with the same rows masked, a band's first and last sample; rows that S-159 does not do without.
    const std::map<size_t, std::vector<int>> burnt = {
        {0, {3}},      {77, {10, 50}},       {78, {10, 50}},
        {79, {11}},    {1000, {0, 40, 101}}, {1500, {10, 90}},
        {2047, {157}}, {2048, {20}},         {size_t(pixels - 1), {5, 6}}};
    for (const float white : {4095.0f, 40000.0f}) {  // inverted in 16 and in 32 bits
        CycleFrames frames = whole;
        for (size_t s = 0; s < frames.slots.size(); ++s) {
            auto frame = std::make_shared<Frame>(*whole.slots[s]);
            frame->white = white;
            for (const auto& [pixel, rows] : burnt)
                if (scene.sequence.slots[s].kind == SlotKind::basis &&
                    std::count(rows.begin(), rows.end(), scene.sequence.slots[s].row))
                    reinterpret_cast<uint16_t*>(frame->samples.data())[pixel] = uint16_t(white);
            frames.slots[s] = frame;
        }
        const Target target = *develop_cycle(frames, scene.sequence, scene.calibration, noise);
        for (size_t p = 0; p < size_t(pixels); ++p) {
            if (burnt.contains(p)) continue;
            ASSERT_EQ(target.mask[p], 0u) << p;
            ASSERT_EQ(target.variance[p], unmasked.variance[p]) << p;
            ASSERT_EQ(target.noise_gain[p], 1) << p;
            for (size_t i = 0; i < target.lamps.size(); ++i) ASSERT_EQ(target.lamps[i][p], unmasked.lamps[i][p]) << p;
        }
        size_t solved = 0;
        for (const auto& [pixel, rows] : burnt) {
            const Eigen::VectorXd expected = completed(scene, frames, pixel, rows);
            const bool is_solved = !expected.isZero(0);
            solved += is_solved;
            EXPECT_EQ(target.mask[pixel], mask_saturated | (is_solved ? 0u : uint32_t(mask_unsolved))) << pixel;
            EXPECT_TRUE(is_solved ? target.noise_gain[pixel] > 1 : target.noise_gain[pixel] == 0) << pixel;
            // Fills are whole counts: each may be half a count off, which a lamp takes by the magnitude of its weights, 1 / 80.
            const double rounding = double(rows.size()) * 0.5 / 80;
            for (Eigen::Index i = 0; i < expected.size(); ++i)
                ASSERT_NEAR(target.lamps[size_t(i)][pixel], expected(i), rounding + 1e-4) << pixel << " " << i;
        }
        EXPECT_GT(solved, 0u);
        EXPECT_LT(solved, burnt.size());
    }
}

TEST(DevelopMasks, slots_that_cannot_be_replaced_are_refused_by_name_or_estimated_when_asked) {
    Scene scene("hadamard156");
    CycleFrames frames = scene.record();
    const size_t slot = scene.slot_of(42);
    frames.slots[slot] = nullptr;
    const auto refused = develop_cycle(frames, scene.sequence, scene.calibration, noise);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find(std::to_string(slot)), std::string::npos);
    EXPECT_NE(refused.error().message.find("--estimate"), std::string::npos);

    Developer developer(scene.sequence, scene.calibration, noise, {Estimate::smooth, default_stage().lamps});
    const auto target = developer.develop(frames);
    ASSERT_TRUE(target.ok());
    EXPECT_EQ(mask_everywhere(*target), uint32_t(mask_missing | mask_estimated));
    EXPECT_EQ(target->provenance["masked"]["estimated"]["prior"], "smooth");
    // The bias is within its bound, apart from the noise: means over the pixels of a constant picture.
    const double bound = target->provenance["masked"]["estimated"]["worst_bias"],
                 noise_left = scene.prediction(scene.once());
    for (Eigen::Index i = 0; i < scene.truth.size(); ++i) {
        double mean = 0;
        for (const float value : target->lamps[size_t(i)]) mean += value / pixels;
        EXPECT_LT(std::abs(mean - scene.truth(i)), bound + 5 * noise_left / std::sqrt(pixels));
    }
    EXPECT_LT(scene.error_of(*target), 1.1 * noise_left);
}

TEST(DevelopMasks, a_pixel_with_too_few_samples_left_is_zero_and_says_so) {
    Scene scene("s159");
    CycleFrames frames = scene.record();
    constexpr size_t burnt = 70;
    for (size_t s = 0; s < frames.slots.size(); ++s) {
        const Slot& slot = scene.sequence.slots[s];
        if (slot.kind != SlotKind::basis || !slot.lit[77]) continue;
        auto frame = std::make_shared<Frame>(*frames.slots[s]);
        reinterpret_cast<uint16_t*>(frame->samples.data())[burnt] = 4095;
        frames.slots[s] = frame;
    }
    const auto target = develop_cycle(frames, scene.sequence, scene.calibration, noise);
    ASSERT_TRUE(target.ok());
    for (size_t p = 0; p < size_t(pixels); ++p)
        ASSERT_EQ(target->mask[p], p == burnt ? uint32_t(mask_saturated | mask_unsolved) : 0u);
    for (const auto& lamp : target->lamps) EXPECT_EQ(lamp[burnt], 0);
    EXPECT_EQ(target->noise_gain[burnt], 0);
    EXPECT_EQ(target->noise_gain[burnt + 1], 1);

    for (const Estimate estimate : {Estimate::smooth, Estimate::nonnegative}) {
        Developer developer(scene.sequence, scene.calibration, noise, {estimate, default_stage().lamps});
        const Target estimated = *developer.develop(frames);
        EXPECT_EQ(estimated.mask[burnt], uint32_t(mask_saturated | mask_estimated));
        EXPECT_GT(estimated.variance[burnt], estimated.variance[burnt + 1]);
        // What the rows were that saturated is known to be at least white: lamp 77 is as bright as that asks for.
        if (estimate == Estimate::nonnegative) {
            EXPECT_GT(estimated.lamps[77][burnt], 1000);
        }
    }
}

TEST(DevelopMasks, every_thread_count_and_both_orders_of_cycles_give_the_same_bits) {
    Scene scene("s159");
    CycleFrames frames = scene.record();
    frames.slots[scene.slot_of(8)] = nullptr;
    CycleFrames other = scene.record();
    other.slots[scene.slot_of(9)] = nullptr;
    Developer one(scene.sequence, scene.calibration, noise), two(scene.sequence, scene.calibration, noise);
    const Target first = *one.develop(frames);
    (void)*two.develop(other);
    EXPECT_EQ(first.lamps, two.develop(frames)->lamps);
}
