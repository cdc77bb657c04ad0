// SPDX-License-Identifier: MIT
// Voronoi cells of lamps against symmetry, closed forms and brute force.
// links: ols_relight
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>

#include "relight/sphere_cells.hpp"

namespace ols {
namespace {

constexpr double pi = std::numbers::pi;

SphereCells cells_of(const std::vector<Vec3>& directions) {
    auto cells = SphereCells::make(directions);
    EXPECT_TRUE(cells.ok()) << (cells.ok() ? "" : cells.error().message);
    return *cells;
}

double total(const SphereCells& cells) {
    return std::accumulate(cells.solid_angles().begin(), cells.solid_angles().end(), 0.0);
}

std::vector<Vec3> random_directions(int count, unsigned seed, double lowest_y = -1) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<Vec3> directions;
    while (int(directions.size()) < count) {
        const Vec3 d = normalized({normal(generator), normal(generator), normal(generator)});
        if (d.y >= lowest_y) directions.push_back(d);
    }
    return directions;
}

int nearest_by_brute_force(const std::vector<Vec3>& lamps, Vec3 d) {
    const auto farther = [&](Vec3 a, Vec3 b) { return dot(a, d) < dot(b, d); };
    return int(std::max_element(lamps.begin(), lamps.end(), farther) - lamps.begin());
}

std::vector<Vec3> ring(int count) {
    std::vector<Vec3> lamps;
    for (int i = 0; i < count; ++i) lamps.push_back({std::cos(2 * pi * i / count), 0, std::sin(2 * pi * i / count)});
    return lamps;
}

TEST(SphereCells, stage_cells_cover_the_sphere_exactly) {
    EXPECT_NEAR(total(cells_of(stage_lamp_directions())), 4 * pi, 1e-11);
    EXPECT_NEAR(total(cells_of(full_sphere_directions())), 4 * pi, 1e-11);
}

TEST(SphereCells, icosahedral_symmetry_leaves_four_sizes_of_12_30_60_and_60_cells) {
    std::map<long, int> count_by_size;
    const auto cells = cells_of(full_sphere_directions());
    for (double solid_angle : cells.solid_angles()) ++count_by_size[std::lround(solid_angle * 1e9)];
    std::vector<int> counts;
    for (const auto& [size, count] : count_by_size) counts.push_back(count);
    std::sort(counts.begin(), counts.end());
    EXPECT_EQ(counts, (std::vector<int>{12, 30, 60, 60}));
}

TEST(SphereCells, lamps_away_from_the_hole_keep_the_cells_of_the_full_sphere) {
    const auto stage = cells_of(stage_lamp_directions()), full = cells_of(full_sphere_directions());
    double grown = 0, left_out = 0;
    for (int i = 0; i < stage.size(); ++i) {
        if (stage.directions()[i].y > -0.7) {
            EXPECT_NEAR(stage.solid_angle(i), full.solid_angle(i), 1e-12) << i;
        }
        grown += stage.solid_angle(i) - full.solid_angle(i);
    }
    for (int i = stage.size(); i < full.size(); ++i) left_out += full.solid_angle(i);
    EXPECT_NEAR(grown, left_out, 1e-11);
}

TEST(SphereCells, one_lamp_has_the_whole_sphere) {
    const auto cells = cells_of({{0.3, -2, 0.1}});
    EXPECT_NEAR(cells.solid_angle(0), 4 * pi, 1e-12);
    EXPECT_DOUBLE_EQ(cells.reach(0), pi);
    EXPECT_EQ(cells.nearest({0, 1, 0}), 0);
}

TEST(SphereCells, two_lamps_have_half_each_however_close) {
    const auto cells = cells_of({{0, 1, 0}, {0.01, 1, 0}});
    EXPECT_NEAR(cells.solid_angle(0), 2 * pi, 1e-9);
    EXPECT_NEAR(cells.solid_angle(1), 2 * pi, 1e-9);
    EXPECT_NEAR(cells.reach(0), pi - std::atan(0.01) / 2, 1e-9);
}

TEST(SphereCells, lamps_in_one_plane_have_lunes) {
    for (int count : {3, 4, 7, 64}) {
        const auto cells = cells_of(ring(count));
        for (double solid_angle : cells.solid_angles()) EXPECT_NEAR(solid_angle, 4 * pi / count, 1e-9) << count;
        EXPECT_NEAR(cells.reach(0), pi / 2, 1e-9);
    }
}

TEST(SphereCells, cells_of_a_dome_reach_to_the_nadir) {
    const auto lamps = random_directions(60, 7, 0.0);
    const auto cells = cells_of(lamps);
    EXPECT_NEAR(total(cells), 4 * pi, 1e-10);
    const Vec3 nadir = {0, -1, 0};
    const int lamp = nearest_by_brute_force(lamps, nadir);
    EXPECT_EQ(cells.nearest(nadir), lamp);
    EXPECT_GE(cells.reach(lamp), std::acos(dot(lamps[lamp], nadir)) - 1e-12);
}

TEST(SphereCells, every_direction_finds_its_nearest_lamp_from_any_start) {
    for (double lowest_y : {-1.0, 0.2}) {
        const auto lamps = random_directions(80, 11, lowest_y);
        const auto cells = cells_of(lamps);
        int start = 0;
        for (Vec3 d : random_directions(20000, 12)) {
            ASSERT_EQ(cells.nearest(d, start), nearest_by_brute_force(lamps, d));
            start = (start + 17) % cells.size();
        }
    }
}

TEST(SphereCells, solid_angles_agree_with_counted_random_directions) {
    const auto lamps = random_directions(20, 3);
    const auto cells = cells_of(lamps);
    constexpr int samples = 200000;
    std::vector<int> hits(lamps.size());
    for (Vec3 d : random_directions(samples, 4)) ++hits[nearest_by_brute_force(lamps, d)];
    for (int i = 0; i < cells.size(); ++i) {
        const double p = cells.solid_angle(i) / (4 * pi), sigma = std::sqrt(p * (1 - p) / samples);
        EXPECT_NEAR(double(hits[i]) / samples, p, 4.5 * sigma) << i;
    }
}

TEST(SphereCells, reach_is_the_farthest_direction_of_the_cell) {
    const auto lamps = random_directions(12, 21);
    const auto cells = cells_of(lamps);
    std::vector<double> farthest(lamps.size());
    for (Vec3 d : random_directions(200000, 22)) {
        const int lamp = nearest_by_brute_force(lamps, d);
        farthest[lamp] = std::max(farthest[lamp], std::acos(dot(lamps[lamp], d)));
    }
    for (int i = 0; i < cells.size(); ++i) {
        EXPECT_LE(farthest[i], cells.reach(i) + 1e-9);
        EXPECT_GT(farthest[i], cells.reach(i) - 0.05);
    }
}

TEST(SphereCells, lamps_in_the_same_direction_are_refused_by_number) {
    const auto cells = SphereCells::make({{0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {2, 0, 0}});
    ASSERT_FALSE(cells.ok());
    EXPECT_NE(cells.error().message.find("lamps 1 and 3"), std::string::npos) << cells.error().message;
}

TEST(SphereCells, no_lamps_and_directionless_lamps_are_refused) {
    EXPECT_FALSE(SphereCells::make({}).ok());
    EXPECT_FALSE(SphereCells::make({{0, 1, 0}, {0, 0, 0}}).ok());
    EXPECT_FALSE(SphereCells::make({{0, 1, 0}, {NAN, 0, 0}}).ok());
}

}  // namespace
}  // namespace ols
