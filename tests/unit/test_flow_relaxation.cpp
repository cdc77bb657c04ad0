// SPDX-License-Identifier: MIT
// The flows' linear solver against a dense factorisation, and its single pass against whole sweeps done plainly.
// links: ols_flow Eigen3::Eigen
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "flow/flow_relaxation_inl.hpp"

using namespace ols;

namespace {

// A random problem, in rows: every pixel's A = g g' (rank one, so that edges are needed), b, edges to the right and down.
struct Problem {
    int width, height;
    std::vector<double> gx, gy, b1, b2, right, down;

    Problem(int w, int h) : width(w), height(h) {
        std::mt19937 random(3);
        const auto fill = [&](std::vector<double>& plane, double low, double high) {
            plane.resize(size_t(w) * size_t(h));
            for (double& v : plane) v = float(low + (high - low) * double(random()) / 4294967296.0);
        };
        fill(gx, -2, 2), fill(gy, -2, 2), fill(b1, -3, 3), fill(b2, -3, 3), fill(right, 0.5, 2), fill(down, 0.5, 2);
        for (int y = 0; y < h; ++y) right[at(w - 1, y)] = 0;
        for (int x = 0; x < w; ++x) down[at(x, h - 1)] = 0;
    }
    size_t at(int x, int y) const { return size_t(y) * size_t(width) + size_t(x); }

    // Calls `each(neighbour, edge)` for the neighbours of (x, y).
    template <typename Each>
    void neighbours(int x, int y, const Each& each) const {
        if (x + 1 < width) each(at(x + 1, y), right[at(x, y)]);
        if (x > 0) each(at(x - 1, y), right[at(x - 1, y)]);
        if (y + 1 < height) each(at(x, y + 1), down[at(x, y)]);
        if (y > 0) each(at(x, y - 1), down[at(x, y - 1)]);
    }

    Eigen::VectorXd solution() const {
        const auto pixels = Eigen::Index(gx.size());
        Eigen::MatrixXd m = Eigen::MatrixXd::Zero(2 * pixels, 2 * pixels);
        Eigen::VectorXd b(2 * pixels);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const size_t p = at(x, y);
                const auto i = Eigen::Index(2 * p);
                m(i, i) += gx[p] * gx[p], m(i + 1, i + 1) += gy[p] * gy[p];
                m(i, i + 1) += gx[p] * gy[p], m(i + 1, i) += gx[p] * gy[p];
                neighbours(x, y, [&](size_t q, double edge) {
                    for (int k = 0; k < 2; ++k) m(i + k, i + k) += edge, m(i + k, Eigen::Index(2 * q) + k) -= edge;
                });
                b(i) = b1[p], b(i + 1) = b2[p];
            }
        return m.fullPivLu().solve(b);
    }
};

// Hands the problem to the solver as a data term does.
struct GivenTerm {
    const Problem& problem;
    int width() const { return problem.width; }

    void weigh_row(HWY_NAMESPACE::RelaxationRows& rows, CheckeredPlane&, CheckeredPlane&, int y) {
        using Rows = HWY_NAMESPACE::RelaxationRows;
        for (int x = 0; x < problem.width; ++x) {
            const size_t p = problem.at(x, y);
            const int color = (x + y) & 1, i = x >> 1;
            rows.row(Rows::a11, color, y)[i] = float(problem.gx[p] * problem.gx[p]);
            rows.row(Rows::a12, color, y)[i] = float(problem.gx[p] * problem.gy[p]);
            rows.row(Rows::a22, color, y)[i] = float(problem.gy[p] * problem.gy[p]);
            rows.row(Rows::b1, color, y)[i] = float(problem.b1[p]);
            rows.row(Rows::b2, color, y)[i] = float(problem.b2[p]);
            rows.row(Rows::right, color, y)[i] = float(problem.right[p]);
            rows.row(Rows::down, color, y)[i] = float(problem.down[p]);
        }
    }
};

struct Flow {
    CheckeredPlane u, v;
    explicit Flow(const Problem& problem, int sweeps, float relaxation)
        : u(problem.width, problem.height), v(problem.width, problem.height) {
        GivenTerm term{problem};
        HWY_NAMESPACE::relax(term, u, v, sweeps, relaxation);
    }
    double at(int x, int y, int component) { return (component ? v : u).row((x + y) & 1, y)[x >> 1]; }
};

// Sweep after sweep over the whole image, in double precision.
std::vector<Eigen::Vector2d> plain_sweeps(const Problem& problem, int sweeps, double relaxation) {
    std::vector<Eigen::Vector2d> w(problem.gx.size(), Eigen::Vector2d::Zero());
    for (int half_sweep = 0; half_sweep < 2 * sweeps; ++half_sweep)
        for (int y = 0; y < problem.height; ++y)
            for (int x = (half_sweep + y) & 1; x < problem.width; x += 2) {
                const size_t p = problem.at(x, y);
                const Eigen::Vector2d g(problem.gx[p], problem.gy[p]);
                Eigen::Matrix2d m = g * g.transpose();
                Eigen::Vector2d sum(problem.b1[p], problem.b2[p]);
                problem.neighbours(x, y, [&](size_t q, double edge) {
                    m += edge * Eigen::Matrix2d::Identity();
                    sum += edge * w[q];
                });
                w[p] += relaxation * (m.inverse() * sum - w[p]);
            }
    return w;
}

}  // namespace

TEST(FlowRelaxation, converges_to_the_solution_of_the_whole_system) {
    for (const auto& [width, height] :
         {std::pair(9, 7), std::pair(8, 6), std::pair(2, 11), std::pair(1, 5), std::pair(6, 1)}) {
        const Problem problem(width, height);
        const Eigen::VectorXd wanted = problem.solution();
        Flow flow(problem, 400, 1.5f);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                for (int k = 0; k < 2; ++k)
                    ASSERT_NEAR(flow.at(x, y, k), wanted(Eigen::Index(2 * problem.at(x, y)) + k), 1e-3)
                        << width << " x " << height << " at " << x << ", " << y;
    }
}

TEST(FlowRelaxation, does_in_one_pass_what_whole_sweeps_do) {
    const Problem problem(37, 29);  // more rows than the ring holds
    for (const int sweeps : {1, 3, 6}) {
        const std::vector<Eigen::Vector2d> wanted = plain_sweeps(problem, sweeps, 1.9);
        Flow flow(problem, sweeps, 1.9f);
        for (int y = 0; y < problem.height; ++y)
            for (int x = 0; x < problem.width; ++x)
                for (int k = 0; k < 2; ++k)
                    ASSERT_NEAR(flow.at(x, y, k), wanted[problem.at(x, y)](k), 2e-4) << x << ", " << y;
    }
}

TEST(FlowRelaxation, leaves_a_pixel_without_data_or_neighbours_at_zero) {
    Problem problem(1, 1);
    problem.gx[0] = problem.gy[0] = problem.b1[0] = problem.b2[0] = 0;
    Flow flow(problem, 5, 1.9f);
    EXPECT_EQ(flow.at(0, 0, 0), 0);
    EXPECT_EQ(flow.at(0, 0, 1), 0);
}
