// SPDX-License-Identifier: MIT
// A highlight that saturates some rows of a multiplexed basis: clipped counts move every lamp of the pixel.
// links: ols_demultiplex
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "demultiplex/row_filler.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

constexpr double white = 3000;  // counts above black

struct Pixel {
    Basis basis = *find_basis("s159");
    FillModel model = fill_model(basis);
    std::vector<LightPosition> lights = image_lights(basis, named_lamps());
    Eigen::VectorXd truth{156}, rows{159};
    std::vector<int> saturated;

    // A matte surface of 12 counts and a highlight of lamps 60 and its neighbours.
    Pixel(double highlight, int exponent) {
        add_smooth_prior(model, lights);
        for (int i = 0; i < 156; ++i) {
            const Vec3 d = lights[size_t(i)].direction;
            truth(i) = 12 * std::max(0.0, dot(normalized({0.2, 0.5, 0.8}), d)) +
                       highlight * std::pow(std::max(0.0, dot(lights[60].direction, d)), exponent);
        }
        for (int r = 0; r < 159; ++r) {
            rows(r) = 0;
            for (int i = 0; i < 156; ++i) rows(r) += basis.light(r, i) * truth(i);
            if (rows(r) >= white) saturated.push_back(r);
        }
    }

    double naive_error() const { return (model.inverse * rows.cwiseMin(white) - truth).cwiseAbs().maxCoeff(); }

    // Through the filler, as takes go; largest error of a lamp, and what became of the sample.
    double our_error(Estimate estimate, SampleFill& told, const std::vector<int>& masked) const {
        std::vector<float> column(159);
        std::vector<float*> pointers;
        for (int r = 0; r < 159; ++r) column[size_t(r)] = float(rows(r));
        for (const int r : masked) column[size_t(r)] = masked_sample<float>;
        for (float& row : column) pointers.push_back(&row);
        FillCache cache(model, estimate);
        const std::vector<float> whites = {float(white)};
        const std::vector<uint8_t> marks = {1};
        std::vector<SampleFill> fills(1);
        fill_rows(RowFiller(cache, {{}, whites, {}, {2.68, 0}}, fills), pointers, marks);
        told = fills[0];
        Eigen::VectorXd filled(159);
        for (int r = 0; r < 159; ++r) filled(r) = double(column[size_t(r)]);
        return (model.inverse * filled - truth).cwiseAbs().maxCoeff();
    }
};

}  // namespace

// Bound: one row short, s159 has two more checks than it needs. Weights are floats, 159 of them of 2^-24 of 4000 counts, and
// 1/80 of that in a lamp.
TEST(SaturatedHighlight, in_one_row_is_solved_exactly) {
    Pixel pixel(300, 30);
    // The brightest row alone is above white.
    pixel.saturated = {0};
    for (int r = 0; r < 159; ++r)
        if (pixel.rows(r) > pixel.rows(pixel.saturated[0])) pixel.saturated[0] = r;
    SampleFill told;
    const double ours = pixel.our_error(Estimate::none, told, pixel.saturated);
    EXPECT_EQ(told.kind, FillKind::solved);
    // Clipped a third below what it was.
    Eigen::VectorXd clipped = pixel.rows;
    clipped(pixel.saturated[0]) *= 2 / 3.0;
    const double naive = (pixel.model.inverse * clipped - pixel.truth).cwiseAbs().maxCoeff();
    expect_within("a highlight saturates one row of s159", naive, ours, 159 * 4000 * 0x1p-24 / 80, "counts");
}

// Bound: the truth agrees with the unsaturated rows, has no negative lamp and none of its saturated rows below white: both it
// and the estimate lie in the ball of optimal recovery (demultiplex/estimate_bound.hpp) of radius B = |truth|_K around
// the smooth estimate, so that they are at most power (B + |estimate|_K) apart, and the estimate's norm is at most 2 B.
TEST(SaturatedHighlight, of_several_lamps_is_estimated_within_its_bound) {
    const Pixel pixel(1400, 20);
    ASSERT_GT(pixel.saturated.size(), 10u);
    SampleFill told;
    const double ours = pixel.our_error(Estimate::nonnegative, told, pixel.saturated);
    EXPECT_EQ(told.kind, FillKind::estimated);
    const double norm = std::sqrt(pixel.truth.dot(pixel.model.precision * pixel.truth));
    EXPECT_LE(ours, 3 * told.worst_power * norm);
    // The bound is wide; what the constraints find is far inside it, and far from what clipping gives.
    EXPECT_LT(ours, 0.5 * pixel.naive_error());
    record_case(fmt::format("a highlight of several lamps saturates {} rows of s159", pixel.saturated.size()),
                with_unit(pixel.naive_error(), "counts"), with_unit(ours, "counts"),
                with_unit(3 * told.worst_power * norm, "counts"));
}

TEST(SaturatedHighlight, in_every_row_leaves_nothing_to_solve) {
    const Pixel pixel(1400, 20);
    std::vector<int> all(159);
    for (int r = 0; r < 159; ++r) all[size_t(r)] = r;
    for (const Estimate estimate : {Estimate::none, Estimate::smooth, Estimate::nonnegative}) {
        SampleFill told;
        pixel.our_error(estimate, told, all);
        EXPECT_EQ(told.kind, FillKind::unsolved);
        EXPECT_EQ(told.noise_gain, 0);
    }
    record_case("a pixel saturates in every row", "every lamp a made-up value", "unsolved: 0 and masked", "mark");
}

// Bound: 0, and what squares of the smallest prior weight leave of it. All rows are 0, and so are all lamps and every fill.
TEST(SaturatedHighlight, is_not_seen_where_everything_is_dark) {
    Pixel pixel(0, 1);
    pixel.rows.setZero();
    pixel.truth.setZero();
    for (const Estimate estimate : {Estimate::smooth, Estimate::nonnegative}) {
        SampleFill told;
        EXPECT_LT(pixel.our_error(estimate, told, {1, 2, 3, 50, 51}), 1e-20) << int(estimate);
        EXPECT_EQ(told.kind, FillKind::estimated);
    }
    record_case("a dark pixel with five rows lost", "0", "0", "0");
}
