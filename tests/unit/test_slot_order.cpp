// SPDX-License-Identifier: MIT
// The order of rows against every order of a small cycle, and against random orders of large ones, by a Fourier sum of its own.
// links: ols_stage
#include "stage/slot_order.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <complex>
#include <numbers>
#include <numeric>
#include <random>

#include "stage/basis_inverse.hpp"

using namespace ols;

namespace {

// |X(k) / X(0)| of light at the slots.
double modulation(const std::vector<double>& light, int harmonic) {
    std::complex<double> sum = 0;
    for (size_t s = 0; s < light.size(); ++s)
        sum += std::polar(light[s], 2 * std::numbers::pi * harmonic * double(s) / double(light.size()));
    return std::abs(sum) / std::accumulate(light.begin(), light.end(), 0.0);
}

std::vector<double> light_of(const Basis& basis, const std::vector<int>& order, const std::vector<int>& places,
                             int slots, int lamp) {
    std::vector<double> light(size_t(slots), 0.0);
    for (size_t n = 0; n < order.size(); ++n) light[size_t(places[n])] = basis.light(order[n], lamp);
    return light;
}

// Mean over lamps of the modulation at the cycle's own rate.
double mean_modulation(const Basis& basis, const std::vector<int>& order, const std::vector<int>& places, int slots) {
    double sum = 0;
    for (int lamp = 0; lamp < basis.lamps; ++lamp) sum += modulation(light_of(basis, order, places, slots, lamp), 1);
    return sum / basis.lamps;
}

// Two of 18 places are the landmarks', as in a take.
std::vector<int> places_of(int rows) {
    std::vector<int> places;
    for (int slot = 0; int(places.size()) < rows; ++slot)
        if (slot % 18 > 1) places.push_back(slot);
    return places;
}

Basis small_basis(int lamps, const std::vector<uint8_t>& levels) {
    Basis basis;
    basis.lamps = lamps;
    basis.rows = int(levels.size()) / lamps;
    basis.levels = levels;
    return basis;
}

// What spread_rows minimises, summed harmonic by harmonic: each lamp's mean, and all lamps together.
double unevenness(const Basis& basis, const std::vector<int>& order, const std::vector<int>& places, int slots) {
    double sum = 0;
    std::vector<double> whole(size_t(slots), 0.0);
    for (int k = 1; k <= 400; ++k)
        for (int lamp = 0; lamp < basis.lamps; ++lamp) {
            const auto light = light_of(basis, order, places, slots, lamp);
            for (size_t s = 0; k == 1 && s < light.size(); ++s) whole[s] += light[s];
            sum += std::pow(modulation(light, k) / k, 2) / basis.lamps;
        }
    for (int k = 1; k <= 400; ++k) sum += std::pow(modulation(whole, k) / k, 2);
    return sum;
}

// The bursts of some places of an order, with the next cycle's after its end, after which the rows that are left lack rank.
int lost_bursts(const Basis& basis, const std::vector<int>& order, const std::vector<int>& places_of_burst) {
    Eigen::MatrixXd light(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) light(r, i) = basis.light(r, i);
    const Eigen::MatrixXd normal = light.transpose() * light;
    int lost = 0;
    for (size_t first = 0; first < order.size(); ++first) {
        Eigen::MatrixXd left = normal;
        for (const int place : places_of_burst) {
            const auto row = light.row(order[(first + size_t(place)) % order.size()]);
            left -= row.transpose() * row;
        }
        lost += Eigen::LDLT<Eigen::MatrixXd>(left).vectorD().minCoeff() < 1e-6;
    }
    return lost;
}

// In a cycle of 180 slots: at most `share` of what lamps flicker at the cycle's rate in each of twenty random orders.
void expect_less_flicker_than_random_orders(const Basis& basis, double share) {
    const auto places = places_of(basis.rows);
    const double ours = mean_modulation(basis, spread_rows(basis, places, 180), places, 180);
    std::vector<int> order(size_t(basis.rows));
    std::iota(order.begin(), order.end(), 0);
    std::mt19937 generator(1);
    for (int n = 0; n < 20; ++n) {
        std::shuffle(order.begin(), order.end(), generator);
        EXPECT_LT(ours, share * mean_modulation(basis, order, places, 180));
    }
}

}  // namespace

TEST(SlotOrder, s_matrices_with_columns_to_spare_lose_no_image_to_any_burst_of_two_or_three_or_two_beside_one) {
    for (const char* name : {"s159", "paley163"}) {
        const Basis basis = *find_basis(name);
        const auto order = spread_rows(basis, places_of(basis.rows), basis.rows > 160 ? 198 : 180);
        EXPECT_EQ(lost_bursts(basis, order, {0, 1}), 0) << name;
        EXPECT_EQ(lost_bursts(basis, order, {0, 2}), 0) << name;
        EXPECT_EQ(lost_bursts(basis, order, {0, 1, 2}), 0) << name;
    }
}

TEST(SlotOrder, that_costs_s159_a_part_of_what_evenness_gains_over_random_orders) {
    expect_less_flicker_than_random_orders(*find_basis("s159"), 0.8);
}

TEST(SlotOrder, of_all_orders_of_a_small_cycle_none_loses_fewer_pairs_of_neighbours) {
    // Rows that stand twice: only the other makes up for one.
    Basis twice = small_basis(4, {1, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1});
    twice = *with_least_squares(std::move(twice));
    const std::vector<int> places = {2, 3, 4, 5, 6, 7, 8};
    const int ours = lost_bursts(twice, spread_rows(twice, places, 9), {0, 1});
    std::vector<int> order = {0, 1, 2, 3, 4, 5, 6};
    int fewest = ours, most = 0;
    do {
        const int lost = lost_bursts(twice, order, {0, 1});
        fewest = std::min(fewest, lost);
        most = std::max(most, lost);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_EQ(ours, fewest);
    EXPECT_LT(ours, most);
}

TEST(SlotOrder, every_row_stands_once) {
    for (const char* name : {"single", "triangle", "s159", "spherical_harmonics:3"}) {
        const Basis basis = *find_basis(name);
        auto order = spread_rows(basis, places_of(basis.rows), 400);
        std::sort(order.begin(), order.end());
        for (int r = 0; r < basis.rows; ++r) ASSERT_EQ(order[size_t(r)], r) << name;
    }
}

TEST(SlotOrder, of_all_orders_of_a_small_cycle_none_is_more_than_a_tenth_more_even) {
    const Basis bases[] = {small_basis(2, {1, 0, 1, 0, 1, 0, 0, 1, 0, 1, 0, 1}),
                           small_basis(3, {1, 1, 0, 1, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 1, 0, 0, 1})};
    const std::vector<int> places = {2, 3, 4, 5, 7, 8};
    for (const Basis& basis : bases) {
        const double ours = unevenness(basis, spread_rows(basis, places, 9), places, 9);
        std::vector<int> order = {0, 1, 2, 3, 4, 5};
        double best = ours;
        do best = std::min(best, unevenness(basis, order, places, 9));
        while (std::next_permutation(order.begin(), order.end()));
        EXPECT_LT(ours, best * 1.1);
    }
}

// Wenger 5.2: each lamp is lit in about three triangles, far apart.
TEST(SlotOrder, triangles_flicker_at_the_cycles_rate_half_as_much_as_in_any_of_twenty_random_orders) {
    expect_less_flicker_than_random_orders(*find_basis("triangle"), 0.5);
}

// The rows of a whole S-matrix have one inner product for all pairs: the sum over lamps is the same in any order, and what
// one lamp gains another loses. Nothing is moved.
TEST(SlotOrder, a_whole_s_matrix_keeps_the_order_it_begins_with) {
    Basis basis = small_basis(7, std::vector<uint8_t>(49));
    for (int r = 0; r < 7; ++r)
        for (const int offset : {0, 1, 3}) basis.levels[size_t(r * 7 + (r + offset) % 7)] = 1;
    const std::vector<int> places = {2, 3, 4, 5, 6, 7, 8};
    // 7 / golden ratio = 4.3.
    EXPECT_EQ(spread_rows(basis, places, 9), (std::vector<int>{0, 4, 1, 5, 2, 6, 3}));
}
