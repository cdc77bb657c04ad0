// SPDX-License-Identifier: MIT
// Tiles with masked samples: grouped sums against sums written out, on every SIMD path; bounds that estimates respect.
// links: ols_demultiplex
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "demultiplex/bounded_fill.hpp"
#include "demultiplex/demultiplex.hpp"
#include "demultiplex/hadamard_tile.hpp"
#include "demultiplex/row_filler.hpp"

using namespace ols;

namespace {

struct Problem {
    Basis basis = *find_basis("s159");
    FillModel model = fill_model(basis);
    std::vector<std::vector<int32_t>> rows;  // with masked samples
    std::vector<std::vector<int>> masked;    // rows, by sample

    // Random counts; highlights of runs of samples, scattered samples, and one lost row where asked for.
    Problem(size_t samples, bool lost_row) : rows(159, std::vector<int32_t>(samples)), masked(samples) {
        add_smooth_prior(model, image_lights(basis, named_lamps()));
        std::mt19937 random(9);
        for (auto& row : rows)
            for (int32_t& count : row) count = int32_t(random() % 3000) - 20;
        for (size_t p = 0; p < samples; ++p) {
            if (p % 50 < 9)
                for (int row = 0; row < 159; ++row)
                    if (basis.lit(row, int(p / 50) % 156)) mask(row, p);
            if (random() % 7 == 0) mask(int(random() % 159), p);
            if (lost_row) mask(11, p);
        }
    }
    void mask(int row, size_t p) {
        if (rows[size_t(row)][p] == masked_sample<int32_t>) return;
        rows[size_t(row)][p] = masked_sample<int32_t>;
        masked[p].push_back(row);
        std::sort(masked[p].begin(), masked[p].end());
    }
};

std::vector<std::vector<int32_t>> filled_rows(const Problem& problem, std::vector<SampleFill>& fills) {
    auto rows = problem.rows;
    std::vector<int32_t*> pointers;
    for (auto& row : rows) pointers.push_back(row.data());
    std::vector<uint8_t> marks;
    for (const auto& masked : problem.masked) marks.push_back(!masked.empty());
    fills.assign(marks.size(), {});
    FillCache cache(problem.model, Estimate::smooth, 4);  // far fewer than there are sets
    fill_rows(RowFiller(cache, {}, fills), pointers, marks);
    return rows;
}

}  // namespace

TEST(RowFiller, every_sample_is_filled_by_its_own_rows_on_every_path) {
    for (const bool lost_row : {false, true}) {
        const Problem problem(203, lost_row);
        for (const char* path : tile_paths()) {
            choose_tile_path(path);
            std::vector<SampleFill> fills;
            const auto rows = filled_rows(problem, fills);
            for (size_t p = 0; p < problem.masked.size(); ++p) {
                const auto& masked = problem.masked[p];
                if (masked.empty()) {
                    EXPECT_EQ(fills[p].kind, FillKind::none);
                    continue;
                }
                const RowFill fill = row_fill(problem.model, masked, Estimate::smooth);
                EXPECT_EQ(fills[p].kind, fill.kind);
                for (size_t r = 0; r < 159; ++r) {
                    const auto k = std::find(masked.begin(), masked.end(), int(r)) - masked.begin();
                    if (size_t(k) == masked.size()) {
                        ASSERT_EQ(rows[r][p], problem.rows[r][p]);
                        continue;
                    }
                    float sum = 0;  // rows in order, in float: the same bits as every path
                    for (size_t row = 0; row < 159; ++row) {
                        const int32_t count = problem.rows[row][p];
                        sum +=
                            fill.weights[size_t(k) * 159 + row] * (count == masked_sample<int32_t> ? 0 : float(count));
                    }
                    ASSERT_EQ(rows[r][p], std::lround(sum)) << path << " sample " << p << " row " << r;
                }
            }
        }
        choose_tile_path(nullptr);
    }
}

TEST(RowFiller, the_inversion_that_asks_for_fills_gives_what_filled_rows_give) {
    const Problem problem(203, true);
    std::vector<SampleFill> fills, again(problem.masked.size());
    const auto rows = filled_rows(problem, fills);
    std::vector<std::vector<float>> expected(156, std::vector<float>(203)), lamps = expected;
    std::vector<const int32_t*> full, holed;
    std::vector<float*> expected_out, out;
    for (size_t r = 0; r < rows.size(); ++r) {
        full.push_back(rows[r].data());
        holed.push_back(r == 11 ? nullptr : problem.rows[r].data());  // the lost row
    }
    for (size_t i = 0; i < lamps.size(); ++i)
        expected_out.push_back(expected[i].data()), out.push_back(lamps[i].data());
    demultiplex(problem.basis, full, 203, expected_out);
    FillCache cache(problem.model, Estimate::smooth);
    const RowFiller filler(cache, {}, again);
    demultiplex(problem.basis, holed, 203, out, {{}, 2, &filler});
    EXPECT_EQ(lamps, expected);
}

TEST(RowFiller, a_constant_under_all_rows_that_is_no_light_stays_a_constant) {
    Problem with(64, true), without(64, true);
    std::vector<float> offset(64, 0.4f);
    std::vector<std::vector<float>> a(159, std::vector<float>(64)), b = a;
    std::vector<float*> pa, pb;
    for (size_t r = 0; r < 159; ++r) {
        for (size_t p = 0; p < 64; ++p) {
            const int32_t count = without.rows[r][p];
            const bool masked = count == masked_sample<int32_t>;
            a[r][p] = masked ? masked_sample<float> : float(count);
            b[r][p] = a[r][p] + offset[p];
        }
        pa.push_back(a[r].data()), pb.push_back(b[r].data());
    }
    const std::vector<uint8_t> marks(64, 1);
    std::vector<SampleFill> fills(64);
    FillCache cache(with.model, Estimate::smooth);
    fill_rows(RowFiller(cache, {}, fills), pa, marks);
    fill_rows(RowFiller(cache, {offset, {}, {}, {}}, fills), pb, marks);
    for (size_t r = 0; r < 159; ++r)
        for (size_t p = 0; p < 64; ++p) ASSERT_NEAR(b[r][p], a[r][p] + offset[p], 0.02);  // sums of 159 floats of 3000
}

TEST(BoundFill, the_result_makes_the_stated_function_least) {
    // Against its gradient, which must vanish at the result: the function is convex.
    const Problem problem(1, false);
    const FillModel& model = problem.model;
    std::mt19937 random(2);
    std::uniform_real_distribution<double> uniform(0, 1);
    Eigen::VectorXd truth = Eigen::VectorXd::NullaryExpr(156, [&] { return std::max(0.0, 40 * uniform(random) - 25); });
    truth(60) = 900, truth(61) = 700;
    Eigen::VectorXd rows(159);
    for (int r = 0; r < 159; ++r) {
        rows(r) = 0;
        for (int i = 0; i < 156; ++i) rows(r) += problem.basis.light(r, i) * truth(i);
    }
    std::vector<int> masked;
    for (int r = 0; r < 159; ++r)
        if (problem.basis.lit(r, 60) && problem.basis.lit(r, 61)) masked.push_back(r);
    const RowFill fill = row_fill(model, masked, Estimate::nonnegative);
    const Eigen::VectorXd exact = rows;
    for (size_t k = 0; k < masked.size(); ++k) {
        double sum = 0;
        for (int r = 0; r < 159; ++r) sum += fill.weights[k * 159 + size_t(r)] * exact(r);
        rows(masked[k]) = sum;
    }
    const Eigen::VectorXd smooth = rows;
    const FillBounds bounds{8, std::vector<double>(masked.size(), 1500)};
    bound_fill(model, masked, bounds, rows);

    const double row_weight = 1 / 64.0, image_weight = row_weight * 156 / model.spread.trace();
    const Eigen::VectorXd start = model.inverse * smooth;
    const double tau2 = start.dot(model.precision * start) / 156;
    const auto value = [&](const Eigen::VectorXd& y) {
        const Eigen::VectorXd x = model.inverse * y;
        double below = 0;
        for (const int row : masked) below += std::pow(std::max(0.0, 1500 - y(row)), 2);
        return x.dot(model.precision * x) / tau2 + row_weight * y.dot(model.residual * y) +
               image_weight * x.cwiseMin(0).squaredNorm() + row_weight * below;
    };
    const double least = value(rows);
    EXPECT_LT(least, value(smooth));
    for (size_t k = 0; k < masked.size(); k += 5)
        for (const double step : {-1.0, 1.0}) {
            Eigen::VectorXd moved = rows;
            moved(masked[k]) += step;
            EXPECT_GE(value(moved), least * (1 - 1e-8));
        }
    // Twenty rows with both lamps: nothing but their sum is hidden, and bounds find what smoothness alone does not.
    const auto error = [&](const Eigen::VectorXd& y) { return (model.inverse * y - truth).norm(); };
    EXPECT_LT(error(rows), 0.5 * error(smooth));
}
