// SPDX-License-Identifier: MIT
// links: ols_develop
#include "develop/parity_witness.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "lit_picture.hpp"
#include "stage/row_losses.hpp"

using namespace ols;

namespace {

constexpr double counts = 12;  // of a lamp: skin on the paper's stage
// The squared difference of two rows is 2.5 times their noise with 12 counts, and c^2 = 1 / 40 of two rows that one check tells apart: 5.8
// sigma of 4800 samples, 6.2 being asked for. Frames have more samples; here it is light.
constexpr double bright = 60;

ParityVerdict verdict_of(ParityWitness& witness, const ParitySamples& samples, bool stands_still = false) {
    return witness.judge(samples, {}, stands_still, 1);
}

// Rows that no check tells apart, and rows that any does.
std::pair<int, int> pair_of(const Basis& basis, bool alike) {
    const Eigen::MatrixXd checks = parity_checks(basis);
    for (int j = 31; j < basis.rows; ++j)
        if (((checks.row(30) - checks.row(j)).norm() < 1e-9) == alike) return {30, j};
    return {-1, -1};
}

}  // namespace

// The dimension is rows - rank of the levels, by arithmetic: ranks from docs/bases.md and design, N' P = 0 entry by entry.
TEST(ParityChecks, are_zero_under_every_lamp) {
    for (const auto& [name, dimension] : std::vector<std::pair<std::string, int>>{{"s159", 3},
                                                                                  {"paley163", 7},
                                                                                  {"triangle", 3},
                                                                                  {"triangle300", 144},
                                                                                  {"hadamard156", 0},
                                                                                  {"planes156", 0},
                                                                                  {"single", 0}}) {
        const Basis basis = *find_basis(name);
        const Eigen::MatrixXd checks = parity_checks(basis);
        EXPECT_EQ(checks.cols(), dimension) << name;
        for (int lamp = 0; lamp < basis.lamps && dimension > 0; ++lamp) {
            Eigen::VectorXd column(basis.rows);
            for (int row = 0; row < basis.rows; ++row) column(row) = basis.light(row, lamp);
            EXPECT_LT((checks.transpose() * column).cwiseAbs().maxCoeff(), 1e-11) << name << lamp;
        }
        EXPECT_LT((checks.transpose() * checks - Eigen::MatrixXd::Identity(dimension, dimension)).norm(), 1e-11);
    }
}

// z'z / v is chi-square of three degrees: its mean over n samples is 3 +- sqrt(6 / n), and 5 % of them are beyond 7.815, give or take
// the binomial's deviation. Rounding to whole counts adds 1 / 12, which v has.
TEST(ParityWitness, what_is_left_of_noise_is_chi_square) {
    const LitPicture picture("s159", counts);
    const auto samples = picture.samples(LitPicture::exposed(picture.rows(), 1));
    const Eigen::MatrixXd checks = parity_checks(picture.basis);
    double sum = 0, beyond = 0;
    for (Eigen::Index k = 0; k < samples.counts().cols(); ++k) {
        const double square =
            (checks.transpose() * samples.counts().col(k).cast<double>()).squaredNorm() / samples.variance()(k);
        sum += square, beyond += square > 7.8147;
    }
    const double n = double(LitPicture::pixels);
    // The mean of 159 counts, which v is made of, has a deviation of at most 1 % in sigma: 2 % in v at most, one-sided here by the dark.
    EXPECT_NEAR(sum / n, 3, 5 * std::sqrt(6 / n) + 0.06);
    EXPECT_NEAR(beyond / n, 0.05, 5 * std::sqrt(0.05 * 0.95 / n) + 0.005);
    ParityWitness witness(picture.basis);
    EXPECT_NEAR(verdict_of(witness, samples).chi_square, sum / n / 3, 1e-6);
}

// Two searches of 1e-4 each at most: of 60 pictures none has more than one, but for a chance of 60 * 59 / 2 * 4e-8 = 7e-5.
TEST(ParityWitness, noise_alone_is_hardly_ever_suspect) {
    for (const double light : {0.0, 0.3, 12.0}) {
        const LitPicture picture("s159", light);
        const auto rows = picture.rows();
        ParityWitness witness(picture.basis);
        int suspect = 0;
        for (unsigned seed = 0; seed < 20; ++seed)
            suspect +=
                verdict_of(witness, picture.samples(LitPicture::exposed(rows, seed), 2), true).finding.has_value();
        EXPECT_LE(suspect, 1) << light;
    }
}

TEST(ParityWitness, rows_that_were_swapped_are_named) {
    const LitPicture picture("s159", bright);
    ParityWitness witness(picture.basis);
    for (const double share : {1.0, 0.5, 0.25}) {
        const auto [i, j] = pair_of(picture.basis, false);
        auto rows = LitPicture::exposed(picture.rows(), 3);
        LitPicture::swap(rows, i, j, share);
        const ParityVerdict verdict = verdict_of(witness, picture.samples(rows));
        ASSERT_TRUE(verdict.finding.has_value()) << share;
        EXPECT_EQ(verdict.finding->fault, RowFault::swapped);
        EXPECT_EQ(verdict.finding->candidates.front(), (std::vector<int>{i, j})) << share;
        EXPECT_TRUE(verdict.names_surely()) << share;
        EXPECT_NEAR(verdict.finding->share, share, 1.0 / 8) << share;
    }
}

TEST(ParityWitness, a_swap_that_no_check_tells_is_told_by_the_target_before) {
    const LitPicture picture("s159", counts);
    ParityWitness witness(picture.basis);
    const auto [i, j] = pair_of(picture.basis, true);
    ASSERT_GE(i, 0);
    auto rows = LitPicture::exposed(picture.rows(), 4);
    LitPicture::swap(rows, i, j);
    EXPECT_FALSE(verdict_of(witness, picture.samples(rows)).finding.has_value());

    EXPECT_FALSE(
        verdict_of(witness, picture.samples(LitPicture::exposed(picture.rows(), 5)), true).finding.has_value());
    const ParityVerdict verdict = verdict_of(witness, picture.samples(rows), true);
    ASSERT_TRUE(verdict.finding.has_value());
    EXPECT_EQ(verdict.finding->fault, RowFault::swapped);
    EXPECT_EQ(verdict.finding->candidates, (std::vector<std::vector<int>>{{i, j}}));
    // The next one is compared with the last that was not suspect.
    EXPECT_FALSE(
        verdict_of(witness, picture.samples(LitPicture::exposed(picture.rows(), 6)), true).finding.has_value());
}

// A fresh exposure of another pattern: its noise is its own.
TEST(ParityWitness, a_row_with_anothers_picture_is_named) {
    const LitPicture picture("s159", counts);
    ParityWitness witness(picture.basis);
    auto means = picture.rows();
    const auto [i, j] = pair_of(picture.basis, false);
    means[size_t(i)] = means[size_t(j)];
    const ParityVerdict verdict = verdict_of(witness, picture.samples(LitPicture::exposed(means, 7)));
    ASSERT_TRUE(verdict.finding.has_value());
    EXPECT_EQ(verdict.finding->fault, RowFault::copied);
    const auto& candidates = verdict.finding->candidates;
    EXPECT_EQ(candidates.front(), std::vector<int>{i});
    EXPECT_LE(candidates.size(), 2u);
}

// x_l^2 / v is about 0.6 a sample where the lamp shines, |N_k|^2 is 3 / 159: 4800 samples make some 7 sigma of that. A brighter lamp
// is surer.
TEST(ParityWitness, a_lamp_that_missed_one_row_is_named_and_its_row_among_others) {
    const LitPicture picture("s159", 40);
    ParityWitness witness(picture.basis);
    const int row = 17;
    int lamp = 0;  // the one most in front that the row lights
    for (int l = 0; l < picture.basis.lamps; ++l) {
        const auto sum = [&](int one) {
            return std::accumulate(picture.lamps[size_t(one)].begin(), picture.lamps[size_t(one)].end(), 0.0);
        };
        if (picture.basis.lit(row, l) && (!picture.basis.lit(row, lamp) || sum(l) > sum(lamp))) lamp = l;
    }
    auto means = picture.rows();
    for (size_t p = 0; p < LitPicture::pixels; ++p) means[size_t(row)][p] -= picture.lamps[size_t(lamp)][p];
    const ParityVerdict verdict = verdict_of(witness, picture.samples(LitPicture::exposed(means, 8)));
    ASSERT_TRUE(verdict.finding.has_value());
    EXPECT_EQ(verdict.finding->fault, RowFault::mislit);
    EXPECT_EQ(verdict.finding->lamp, lamp);
    EXPECT_NE(std::ranges::find(verdict.finding->candidates, std::vector<int>{row}), verdict.finding->candidates.end());
    EXPECT_FALSE(verdict.names_surely());
}

TEST(ParityWitness, a_lamp_that_is_out_in_all_rows_makes_no_check_speak) {
    const LitPicture picture("s159", counts);
    ParityWitness witness(picture.basis);
    std::vector<double> factor(156, 1.0);
    factor[40] = 0;
    EXPECT_FALSE(
        verdict_of(witness, picture.samples(LitPicture::exposed(picture.rows(factor), 9))).finding.has_value());
}

TEST(ParityWitness, a_lost_row_costs_a_check_and_a_basis_without_rows_to_spare_has_none) {
    const LitPicture picture("s159", counts);
    ParityWitness witness(picture.basis);
    auto rows = LitPicture::exposed(picture.rows(), 10);
    std::ranges::fill(rows[5], double(std::numeric_limits<int32_t>::lowest()));
    const ParityVerdict verdict = witness.judge(picture.samples(rows, 1, {5}), {5}, false, 1);
    EXPECT_EQ(verdict.checks, 2);
    EXPECT_EQ(verdict.samples, LitPicture::pixels);
    EXPECT_NEAR(verdict.chi_square, 1, 0.1);

    const LitPicture full("hadamard156", counts);
    ParityWitness silent(full.basis);
    EXPECT_EQ(verdict_of(silent, full.samples(LitPicture::exposed(full.rows(), 11))).checks, 0);
}

TEST(ParityWitness, any_number_of_threads_gives_the_same_verdict) {
    const LitPicture picture("s159", bright);
    auto rows = LitPicture::exposed(picture.rows(), 12);
    LitPicture::swap(rows, 3, 90);
    const auto samples = picture.samples(rows);
    ParityWitness one(picture.basis), four(picture.basis);
    const ParityVerdict a = one.judge(samples, {}, false, 1), b = four.judge(samples, {}, false, 4);
    EXPECT_EQ(a.chi_square, b.chi_square);
    ASSERT_TRUE(a.finding && b.finding);
    EXPECT_EQ(a.finding->sigma, b.finding->sigma);
}

// Tables of the normal distribution: Abramowitz and Stegun, table 26.5.
TEST(NormalQuantile, is_that_of_the_tables) {
    EXPECT_NEAR(normal_quantile(0.025), 1.959964, 1e-6);
    EXPECT_NEAR(normal_quantile(0.00135), 2.99998, 1e-5);
    EXPECT_NEAR(normal_quantile(1e-9), 5.99781, 1e-5);
}
