// SPDX-License-Identifier: MIT
// Lost slots of a multiplexed basis, to the last that can be solved and beyond.
// links: ols_demultiplex
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "demultiplex/row_fill.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

struct Errors {
    double naive = 0, ours = 0;  // largest over lamps, counts
};

// A cosine lobe of 50 counts, without noise; the lost rows are zero for the naive inversion.
Errors errors_without(const std::string& name, const std::vector<int>& lost, Estimate estimate, RowFill& fill) {
    const Basis basis = *find_basis(name);
    FillModel model = fill_model(basis);
    const auto lights = image_lights(basis, named_lamps());
    add_smooth_prior(model, lights);
    Eigen::VectorXd truth(basis.images()), rows = Eigen::VectorXd::Zero(basis.rows);
    for (int i = 0; i < basis.images(); ++i) {
        truth(i) = 50 * std::max(0.0, dot(normalized({0.2, 0.5, 0.8}), lights[size_t(i)].direction));
        for (int r = 0; r < basis.rows; ++r) rows(r) += basis.light(r, i) * truth(i);
    }
    rows(lost).setZero();
    Errors errors;
    errors.naive = (model.inverse * rows - truth).cwiseAbs().maxCoeff();
    fill = row_fill(model, lost, estimate);
    if (fill.weights.empty()) return errors;
    const Eigen::VectorXd known = rows;
    for (size_t k = 0; k < lost.size(); ++k) {
        rows(lost[k]) = 0;
        for (int r = 0; r < basis.rows; ++r)
            rows(lost[k]) += fill.weights[k * size_t(basis.rows) + size_t(r)] * known(r);
    }
    errors.ours = (model.inverse * rows - truth).cwiseAbs().maxCoeff();
    return errors;
}

// Rounding of the weights to floats: at most 159 products of 2^-24 of a row's 4000 counts a filled row, times 2 / 160 in a
// lamp, `lost` times. A weight is at most 1 where one row is lost, and grows with the square root of the noise gain.
double rounding_bound(size_t lost, double noise_gain) {
    return double(lost) * std::sqrt(noise_gain) * 159 * 4000 * 0x1p-24 / 80;
}

}  // namespace

// Bound: rounding of the weights to floats, see above; the rows are free of noise.
TEST(LostSlots, one_of_s159_is_made_up_for) {
    RowFill fill;
    const Errors errors = errors_without("s159", {42}, Estimate::none, fill);
    EXPECT_EQ(fill.kind, FillKind::solved);
    expect_within("one slot of s159 lost", errors.naive, errors.ours, rounding_bound(1, fill.noise_gain), "counts");
}

// Bound: as for one.
TEST(LostSlots, the_last_solvable_three_of_s159_are_made_up_for) {
    RowFill fill;
    std::vector<int> lost;
    Errors errors;
    // The first three that can be solved; their noise gain is recorded, not bounded.
    for (int third = 0; third < 159 && fill.kind != FillKind::solved; ++third) {
        lost = {5, 6, third};
        std::sort(lost.begin(), lost.end());
        if (third != 5 && third != 6) errors = errors_without("s159", lost, Estimate::none, fill);
    }
    ASSERT_EQ(fill.kind, FillKind::solved);
    expect_within("three slots of s159 lost, the most that can be solved", errors.naive, errors.ours,
                  rounding_bound(3, fill.noise_gain), "counts");
}

TEST(LostSlots, the_fourth_of_s159_and_the_first_of_hadamard156_are_refused) {
    RowFill fill;
    const Errors four = errors_without("s159", {1, 2, 30, 77}, Estimate::none, fill);
    EXPECT_EQ(fill.kind, FillKind::unsolved);
    const Errors one = errors_without("hadamard156", {42}, Estimate::none, fill);
    EXPECT_EQ(fill.kind, FillKind::unsolved);
    record_case("a fourth slot of s159, the first of hadamard156 lost",
                "every lamp off by up to " + with_unit(std::max(four.naive, one.naive), "counts"), "refused",
                "refusal");
}

// Bound: the power function times sqrt(B^2 - |estimate|_K^2) with the true norm for B (optimal recovery, Micchelli and Rivlin
// 1977): computed from the truth, which the estimate does not know.
TEST(LostSlots, what_is_estimated_is_within_its_bound) {
    RowFill fill;
    const Errors errors = errors_without("hadamard156", {42}, Estimate::smooth, fill);
    EXPECT_EQ(fill.kind, FillKind::estimated);
    const Basis basis = *find_basis("hadamard156");
    FillModel model = fill_model(basis);
    const auto lights = image_lights(basis, named_lamps());
    add_smooth_prior(model, lights);
    Eigen::VectorXd truth(basis.images());
    for (int i = 0; i < basis.images(); ++i)
        truth(i) = 50 * std::max(0.0, dot(normalized({0.2, 0.5, 0.8}), lights[size_t(i)].direction));
    const double norm = std::sqrt(truth.dot(model.precision * truth));
    expect_within("one slot of hadamard156 lost and estimated", errors.naive, errors.ours, fill.worst_power * norm,
                  "counts");
}
