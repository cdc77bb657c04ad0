// SPDX-License-Identifier: MIT
// Targets of which no slot is wrong, and that look as if one were: motion, the dark, highlights.
// links: ols_take
#include <cmath>
#include <random>

#include "../unit/lit_picture.hpp"
#include "demultiplex/masked_sample.hpp"
#include "develop/parity_witness.hpp"
#include "hard_case.hpp"
#include "moving_take.hpp"
#include "stage/row_losses.hpp"

using namespace ols;

namespace {

// What a competent first version does: |z|^2 of the checks against the camera's noise, five deviations of its mean over n samples,
// sqrt(2 / (n d)).
bool is_suspect_by_noise(double chi_square, double samples, double checks) {
    return chi_square > 1 + 5 * std::sqrt(2 / (samples * checks));
}

}  // namespace

// Bound: no target suspect, as none has a fault. A sheet that turns and passes an edge: alignment leaves more than noise.
TEST(SuspectSlots, of_a_subject_that_moves) {
    moving::Scene scene;
    scene.layers.push_back({.albedo = moving::wavy(1)});
    scene.layers.push_back({.albedo = moving::wavy(2), .radius = 40, .offset = [](double slots) {
                                return moving::Offset{0.08 * slots, 0.03 * slots};
                            }});
    moving::Take take(scene, "s159");
    double naive = 0, ours = 0;
    for (const char* quality : {"none", "preview", "standard"}) {
        const Target target = take.develop(quality, take.middle_target(), {Estimate::none, named_lamps(), 0, 3});
        const nlohmann::json account = target.provenance["witness_account"];
        naive += is_suspect_by_noise(account["chi_square"], account["samples"], account["checks"]);
        ours += account.contains("suspect") + account.contains("lamps");
        EXPECT_FALSE(account.contains("says")) << quality << account.dump();
    }
    expect_within("slots and lamps of a moving subject wrongly suspect, of three qualities", naive, ours, 0, "targets");
}

// Bound: none of ten. Without light all rows look the same: the pair that differs least is no copy.
TEST(SuspectSlots, of_rows_that_all_look_the_same_in_the_dark) {
    const LitPicture picture("s159", 0);
    ParityWitness witness(picture.basis);
    double naive = 0, ours = 0;
    for (unsigned seed = 0; seed < 10; ++seed) {
        const auto rows = LitPicture::exposed(picture.rows(), seed);
        const ParitySamples samples = picture.samples(rows);
        // Naive: two rows that differ by noise alone, to four deviations, are one picture twice.
        double squares = 0;
        for (Eigen::Index k = 0; k < samples.counts().cols(); ++k)
            squares += std::pow(double(samples.counts()(3, k) - samples.counts()(90, k)), 2) /
                       (2 * double(samples.variance()(k)));
        const auto n = double(samples.size());
        naive += std::abs(squares / n - 1) < 4 * std::sqrt(2 / n);
        ours += witness.judge(samples, {}, true, 1).finding.has_value();
    }
    expect_within("slots that look alike in the dark wrongly suspect, of ten targets", naive, ours, 0, "targets");
}

// Bound: none of ten. Half of the picture saturates in half of the rows, which then are no sums of lamps.
TEST(SuspectSlots, of_a_picture_that_saturates) {
    const LitPicture picture("s159", 60);
    ParityWitness witness(picture.basis);
    const auto means = picture.rows();
    double white = 0;
    for (const auto& row : means)
        for (const double count : row) white += count / double(means.size() * row.size());
    double naive = 0, ours = 0;
    for (unsigned seed = 0; seed < 10; ++seed) {
        auto rows = LitPicture::exposed(means, seed), masked = rows;
        for (size_t row = 0; row < rows.size(); ++row)
            for (size_t p = 0; p < LitPicture::pixels; ++p)
                if (rows[row][p] >= white) {
                    rows[row][p] = white;
                    masked[row][p] = double(masked_sample<int32_t>);
                }
        ParityWitness clipped(picture.basis);
        const ParityVerdict as_read = clipped.judge(picture.samples(rows), {}, false, 1);
        naive += is_suspect_by_noise(as_read.chi_square, double(as_read.samples), as_read.checks);
        ours += witness.judge(picture.samples(masked), {}, true, 1).finding.has_value();
    }
    expect_within("slots of a picture that saturates wrongly suspect, of ten targets", naive, ours, 0, "targets");
}
