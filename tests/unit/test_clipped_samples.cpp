// SPDX-License-Identifier: MIT
// Saturated samples that count as they were read: lamps against the inversion of clipped rows written out with Eigen, how far
// they are off, and what no clipped count mends.
// links: ols_develop
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "develop/develop.hpp"

using namespace ols;

namespace {

constexpr int width = 40, height = 4, pixels = width * height, glint_lamp = 77;
constexpr float black = 64.25f;  // not whole, as measured ones are
constexpr double white = 4095 - 64;

// Frames without noise of pixels whose lamps are known, in counts. The calibration's gain is 1: r in counts.
struct Scene {
    Sequence sequence;
    CameraCalibration calibration;
    Eigen::MatrixXd light, inverse;  // rows x lamps, lamps x rows
    Eigen::VectorXd matte;
    std::vector<Eigen::VectorXd> rows;  // of each pixel, whole counts above the whole part of black

    explicit Scene(const std::string& basis) {
        SequenceConfig config;
        config.basis = basis;
        config.basis_exposure_us = 100;
        sequence = *compile_sequence(config, default_stage());
        calibration.black = calibration.flat = Image(width, height, 1);
        std::ranges::fill(calibration.black.data, black);
        std::ranges::fill(calibration.flat.data, 0.01f);
        const int lamps = sequence.basis.images();
        light.resize(sequence.basis.rows, lamps), inverse.resize(lamps, sequence.basis.rows), matte.resize(lamps);
        const auto lights = image_lights(sequence.basis, default_stage().lamps);
        for (int i = 0; i < lamps; ++i) {
            matte(i) = 12 * std::max(0.0, dot(normalized({0.3, 0.4, 0.8}), lights[size_t(i)].direction));
            for (int r = 0; r < light.rows(); ++r)
                light(r, i) = sequence.basis.light(r, i), inverse(i, r) = sequence.basis.inverse(r, i);
        }
        rows.assign(pixels, counted(light * matte));
    }

    static Eigen::VectorXd counted(const Eigen::VectorXd& above_black) {
        return (above_black.array() + 0.25).round().matrix();  // what black has more than whole counts
    }
    void shine(size_t pixel, double counts) {
        Eigen::VectorXd lamps = matte;
        lamps(glint_lamp) += counts;
        rows[pixel] = counted(light * lamps);
    }

    std::shared_ptr<Frame> expose(int row) const {
        auto frame = std::make_shared<Frame>();
        frame->width = width, frame->height = height;
        frame->pitch_bytes = width * sizeof(uint16_t);
        frame->white = 4095;
        frame->exposure_ticks = uint32_t(100 * ticks_per_us);
        frame->samples.resize(size_t(pixels) * sizeof(uint16_t));
        auto* samples = reinterpret_cast<uint16_t*>(frame->samples.data());
        for (size_t p = 0; p < rows.size(); ++p) samples[p] = uint16_t(std::min(rows[p](row), white) + 64);
        return frame;
    }
    CycleFrames record() const {
        CycleFrames frames;
        for (const Slot& slot : sequence.slots)
            frames.slots.push_back(slot.kind == SlotKind::basis ? expose(slot.row) : nullptr);
        return frames;
    }
    size_t slot_of(int row) const {
        size_t s = 0;
        while (sequence.slots[s].row != row) ++s;
        return s;
    }

    Result<Target> develop(const CycleFrames& frames, Estimate estimate) const {
        return Developer(sequence, calibration, NoiseModel(), {estimate, default_stage().lamps}).develop(frames);
    }

    // The lamps of a pixel whose rows are these.
    Eigen::VectorXd inverted(const Eigen::VectorXd& counts) const { return inverse * (counts.array() - 0.25).matrix(); }
    // What is above white, by row.
    Eigen::VectorXd cut_off(size_t pixel) const { return (rows[pixel].array() - white).max(0).matrix(); }
};

Eigen::VectorXd lamps_of(const Target& target, size_t pixel) {
    Eigen::VectorXd lamps(Eigen::Index(target.lamps.size()));
    for (Eigen::Index i = 0; i < lamps.size(); ++i) lamps(i) = target.lamps[size_t(i)][pixel];
    return lamps;
}

double difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return (a - b).cwiseAbs().maxCoeff();
}

constexpr double rounding = 1e-3;  // floats, of 4000 counts

}  // namespace

TEST(ClippedSamples, of_a_glint_give_its_lamp_about_the_clipping_level_and_leave_no_hole) {
    for (const char* basis : {"s159", "hadamard156"}) {
        Scene scene(basis);
        constexpr size_t glint = 70;
        scene.shine(glint, 9000);
        const Target without = *scene.develop(scene.record(), Estimate::none),
                     target = *scene.develop(scene.record(), Estimate::clipped);
        for (size_t p = 0; p < size_t(pixels); ++p) {
            if (p != glint) {
                EXPECT_EQ(target.mask[p], 0u);
                EXPECT_EQ(lamps_of(target, p), lamps_of(without, p));
            }
        }
        EXPECT_EQ(without.mask[glint], uint32_t(mask_saturated | mask_unsolved));
        EXPECT_EQ(target.mask[glint], uint32_t(mask_saturated | mask_estimated));
        EXPECT_EQ(target.noise_gain[glint], 1);
        const Eigen::VectorXd lamps = lamps_of(target, glint);
        EXPECT_LT(difference(lamps, scene.inverted(scene.rows[glint].cwiseMin(white))), rounding);
        Eigen::Index brightest;
        EXPECT_NEAR(lamps.maxCoeff(&brightest), white, 0.2 * white);
        EXPECT_EQ(brightest, glint_lamp);
        EXPECT_EQ(target.provenance["masked"]["estimated"], (nlohmann::json{{"prior", "clipped"}, {"samples", 1}}));
        EXPECT_EQ(target.provenance["masked"]["unsolved"], 0);
    }
}

// An inverse whose weights are all +-2 / (n + 1), for S-matrices of order n: an error d_k >= 0 of row k is off by 2 / (n + 1) d_k in
// each lamp. Of a lamp that is lit in all of these rows the errors have one sign, and add up.
TEST(ClippedSamples, move_no_lamp_further_than_the_glints_own) {
    Scene scene("s159");
    constexpr size_t glint = 9;
    scene.shine(glint, 6000);
    const Eigen::VectorXd lamps = lamps_of(*scene.develop(scene.record(), Estimate::clipped), glint),
                          errors = lamps - scene.inverted(scene.rows[glint]);
    EXPECT_NEAR(scene.inverse.cwiseAbs().minCoeff(), 2 / 160.0, 1e-12);
    EXPECT_NEAR(scene.inverse.cwiseAbs().maxCoeff(), 2 / 160.0, 1e-12);
    const double bound = 2 / 160.0 * scene.cut_off(glint).sum();
    EXPECT_GT(bound, 1000);
    EXPECT_NEAR(errors(glint_lamp), -bound, rounding);
    EXPECT_LE(errors.cwiseAbs().maxCoeff(), bound + rounding);
    EXPECT_LE(lamps(glint_lamp), white);
}

TEST(ClippedSamples, do_not_count_where_the_other_rows_solve_the_pixel) {
    Scene scene("s159");
    constexpr size_t pixel = 33;
    Eigen::Index brightest;
    scene.rows[pixel] *= 6;  // the brightest row alone is at white
    scene.rows[pixel] *= (white + 1) / scene.rows[pixel].maxCoeff(&brightest);
    scene.rows[pixel] = scene.counted(scene.rows[pixel]);
    ASSERT_EQ((scene.rows[pixel].array() >= white).count(), 1);
    const Target without = *scene.develop(scene.record(), Estimate::none),
                 target = *scene.develop(scene.record(), Estimate::clipped);
    EXPECT_EQ(target.mask[pixel], uint32_t(mask_saturated));
    EXPECT_EQ(target.lamps, without.lamps);
    EXPECT_EQ(target.provenance["masked"], without.provenance["masked"]);
}

// All rows read white: what is recovered is the same under each lamp, as every one has one row more lit than dark.
TEST(ClippedSamples, in_every_row_share_the_clipping_level_among_all_lamps) {
    Scene scene("s159");
    constexpr size_t burnt = 5;
    scene.rows[burnt].setConstant(2 * white);
    const Target target = *scene.develop(scene.record(), Estimate::clipped);
    EXPECT_EQ(target.mask[burnt], uint32_t(mask_saturated | mask_estimated));
    const Eigen::VectorXd lamps = lamps_of(target, burnt);
    EXPECT_LT(difference(lamps, Eigen::VectorXd::Constant(156, (white - 0.25) / 80)), rounding);
}

// The lost row, and only it, is what least squares make of the others.
TEST(ClippedSamples, beside_a_lost_row_fill_it_with_what_they_say) {
    Scene scene("s159");
    constexpr size_t glint = 70;
    scene.shine(glint, 9000);
    for (const int lost : {8, 9}) {  // one in which the glint's lamp is lit, and one in which it is not
        CycleFrames frames = scene.record();
        frames.slots[scene.slot_of(lost)] = nullptr;
        const Target target = *scene.develop(frames, Estimate::clipped);
        EXPECT_EQ(target.mask[glint], uint32_t(mask_saturated | mask_missing | mask_estimated));
        EXPECT_EQ(target.mask[glint + 1], uint32_t(mask_missing));
        EXPECT_GT(target.noise_gain[glint], 1);
        EXPECT_EQ(target.noise_gain[glint], target.noise_gain[glint + 1]);
        const Eigen::MatrixXd pseudo = scene.light.completeOrthogonalDecomposition().pseudoInverse(),
                              residual = Eigen::MatrixXd::Identity(159, 159) - scene.light * pseudo;
        Eigen::VectorXd counts = scene.rows[glint].cwiseMin(white);
        const double own = residual(lost, lost);
        // Black's fraction is in every row, and no light that lamps would explain.
        const Eigen::VectorXd lit = (counts.array() - 0.25).matrix();
        counts(lost) = std::round(-(residual.row(lost).dot(lit) - own * lit(lost)) / own + 0.25);
        EXPECT_LT(difference(lamps_of(target, glint), scene.inverted(counts)), 1 / 80.0 + rounding);
    }
}

TEST(ClippedSamples, stand_in_for_no_slot_that_was_lost) {
    Scene scene("hadamard156");
    scene.shine(70, 9000);
    CycleFrames frames = scene.record();
    frames.slots[scene.slot_of(42)] = nullptr;
    const auto refused = scene.develop(frames, Estimate::clipped);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("--estimate smooth"), std::string::npos);
}

TEST(ClippedSamples, of_a_lamp_alone_are_its_value_as_ever) {
    Scene scene("single");
    scene.shine(70, 9000);
    CycleFrames frames = scene.record();
    frames.slots[scene.slot_of(12)] = nullptr;
    const Target without = *scene.develop(frames, Estimate::none), target = *scene.develop(frames, Estimate::clipped);
    EXPECT_EQ(target.lamps, without.lamps);
    EXPECT_EQ(target.mask, without.mask);
    EXPECT_EQ(target.missing_lamps, std::vector<int>{12});
}
