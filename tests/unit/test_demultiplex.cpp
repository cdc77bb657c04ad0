// SPDX-License-Identifier: MIT
// Demultiplexing: lamps that were multiplexed by hand come back exactly, from any thread count; noise comes out with the
// variance that the basis promises.
// links: ols_demultiplex
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "demultiplex/demultiplex.hpp"
#include "demultiplex/planes.hpp"
#include "demultiplex/variance.hpp"

using namespace ols;

namespace {

template <typename T>
std::vector<const T*> pointers(const std::vector<std::vector<T>>& planes) {
    std::vector<const T*> out;
    for (const auto& plane : planes) out.push_back(plane.data());
    return out;
}

std::vector<float*> outputs(std::vector<std::vector<float>>& planes) {
    std::vector<float*> out;
    for (auto& plane : planes) out.push_back(plane.data());
    return out;
}

using Counts = std::vector<std::vector<int32_t>>;

Counts random_lamps(int lamps, size_t samples, int lowest, int highest) {
    std::mt19937 random(7);
    std::uniform_int_distribution<int> value(lowest, highest);
    Counts out(lamps, std::vector<int32_t>(samples));
    for (auto& plane : out)
        for (auto& v : plane) v = value(random);
    return out;
}

// What a camera sees of each row: the sum of its lit lamps.
Counts multiplexed(const Basis& basis, const Counts& lamps) {
    Counts rows(basis.rows, std::vector<int32_t>(lamps[0].size()));
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i)
            if (basis.lit(r, i))
                for (size_t p = 0; p < lamps[i].size(); ++p) rows[r][p] += lamps[i][p];
    return rows;
}

std::vector<std::vector<float>> demultiplexed(const Basis& basis, const Counts& rows, DemultiplexOptions options = {}) {
    std::vector<std::vector<float>> lamps(basis.lamps, std::vector<float>(rows[0].size()));
    demultiplex(basis, pointers(rows), rows[0].size(), outputs(lamps), options);
    return lamps;
}

}  // namespace

class Demultiplex : public testing::TestWithParam<std::string> {
  protected:
    const Basis basis = *find_basis(GetParam());
};
INSTANTIATE_TEST_SUITE_P(, Demultiplex, testing::Values("single", "planes156", "s159", "hadamard156", "paley163"));

TEST_P(Demultiplex, signed_integer_lamps_come_back_to_a_rounding) {
    const Counts lamps = random_lamps(basis.lamps, 777, -500, 4000);
    const auto back = demultiplexed(basis, multiplexed(basis, lamps));
    for (int i = 0; i < basis.lamps; ++i)
        for (size_t p = 0; p < lamps[i].size(); ++p) ASSERT_FLOAT_EQ(back[i][p], float(lamps[i][p])) << i << " " << p;
}

// Rows that saturate a 16-bit camera everywhere are the largest sums there can be.
TEST_P(Demultiplex, sums_of_16_bit_extremes_do_not_overflow) {
    Counts rows(basis.rows, std::vector<int32_t>(3));
    for (int r = 0; r < basis.rows; ++r) rows[r] = {basis.weight(r, 0) > 0 ? 65535 : -65535, 65535, -65535};
    const auto back = demultiplexed(basis, rows);
    for (int i = 0; i < basis.lamps; ++i)
        for (int p = 0; p < 3; ++p) {
            int64_t sum = 0;
            for (int r = 0; r < basis.rows; ++r) sum += int64_t(basis.weight(r, i)) * rows[r][p];
            EXPECT_FLOAT_EQ(back[i][p], float(double(sum) * basis.scale));
        }
}

TEST_P(Demultiplex, any_thread_count_gives_the_same_bits) {
    const Counts rows = random_lamps(basis.rows, 5000, -100, 4095);
    std::vector<float> gain(5000);
    for (size_t p = 0; p < gain.size(); ++p) gain[p] = 0.001f * float(p % 17 + 1);
    const auto one = demultiplexed(basis, rows, {gain, 1});
    EXPECT_EQ(one, demultiplexed(basis, rows, {gain, 2}));
    EXPECT_EQ(one, demultiplexed(basis, rows, {gain, 5}));
}

TEST_P(Demultiplex, float_rows_come_back_within_rounding) {
    const Counts lamps = random_lamps(basis.lamps, 300, 0, 1000);
    std::vector<std::vector<float>> rows, back(basis.lamps, std::vector<float>(300));
    for (const auto& row : multiplexed(basis, lamps)) {
        rows.emplace_back();
        for (const int32_t v : row) rows.back().push_back(float(v) * 0.125f);  // exact in float: 18 bits
    }
    demultiplex(basis, pointers(rows), 300, outputs(back));
    for (int i = 0; i < basis.lamps; ++i)
        for (size_t p = 0; p < 300; ++p) ASSERT_NEAR(back[i][p], lamps[i][p] * 0.125f, 1e-5);
}

// Fills with what tells row and sample apart.
struct CountingFiller final : SampleFiller {
    explicit CountingFiller(int row_count) : rows(row_count) {}
    void fill(int32_t* tile, size_t begin, size_t count) const override {
        for (int r = 0; r < rows; ++r)
            for (size_t i = 0; i < count; ++i) {
                int32_t& sample = tile[size_t(r) * tile_samples + i];
                if (sample == masked_sample<int32_t>) sample = 100 + r + int32_t((begin + i) % 37);
            }
    }
    int rows;
};

std::vector<std::vector<int16_t>> narrowed(const Counts& rows) {
    std::vector<std::vector<int16_t>> out;
    for (const auto& row : rows) {
        out.emplace_back();
        for (const int32_t v : row)
            out.back().push_back(v == masked_sample<int32_t> ? masked_sample<int16_t> : int16_t(v));
    }
    return out;
}

TEST_P(Demultiplex, rows_of_16_bits_give_the_bits_of_32) {
    for (const int largest : {4095, 32767}) {
        const Counts rows = random_lamps(basis.rows, 2500, -largest, largest);
        std::vector<float> gain(2500);
        for (size_t p = 0; p < gain.size(); ++p) gain[p] = 0.01f * float(p % 13 + 1);
        std::vector<std::vector<float>> lamps(basis.lamps, std::vector<float>(2500));
        demultiplex(basis, pointers(narrowed(rows)), 2500, outputs(lamps), {gain, 2});
        EXPECT_EQ(lamps, demultiplexed(basis, rows, {gain, 1}));
    }
}

TEST_P(Demultiplex, offsets_are_taken_off_the_lamps_at_last) {
    constexpr size_t samples = 1100;  // whole blocks and tiles, and parts of them
    const Counts rows = random_lamps(basis.rows, samples, -4095, 4095);
    const std::vector<float> gain(samples, 0.01f);
    const auto plain = demultiplexed(basis, rows, {gain, 1});
    std::vector<std::vector<float>> offsets(2, std::vector<float>(samples, 0.375f));
    for (size_t p = 0; p < samples; ++p) offsets[1][p] = 0.01f * float(p) - 3;
    std::vector<const float*> of_lamp;
    for (int lamp = 0; lamp < basis.images(); ++lamp) of_lamp.push_back(offsets[size_t(lamp % 2)].data());
    for (const int threads : {1, 3}) {
        const auto lamps = demultiplexed(basis, rows, {.gain = gain, .threads = threads, .offsets = of_lamp});
        for (size_t lamp = 0; lamp < lamps.size(); ++lamp)
            for (size_t p = 0; p < samples; ++p) ASSERT_EQ(lamps[lamp][p], plain[lamp][p] - offsets[lamp % 2][p]);
    }
}

TEST_P(Demultiplex, masked_samples_and_lost_rows_of_16_bits_are_filled_like_those_of_32) {
    Counts rows = random_lamps(basis.rows, 700, -100, 4095);
    std::mt19937 random(2);
    for (int i = 0; i < 300; ++i) rows[random() % rows.size()][random() % 600] = masked_sample<int32_t>;
    rows.back().assign(700, masked_sample<int32_t>);
    const auto narrow = narrowed(rows);
    auto narrow_pointers = pointers(narrow);
    narrow_pointers.back() = nullptr;
    const CountingFiller filler(basis.rows);
    std::vector<std::vector<float>> lamps(basis.lamps, std::vector<float>(700));
    demultiplex(basis, narrow_pointers, 700, outputs(lamps), {{}, 1, &filler});
    EXPECT_EQ(lamps, demultiplexed(basis, rows, {{}, 1, &filler}));
}

// A lamp that is black everywhere, under rows of 1000 counts and unit noise: what comes out is noise alone.
TEST_P(Demultiplex, estimated_variance_is_the_variance_of_many_noisy_inversions) {
    constexpr size_t samples = 4096;
    std::mt19937 random(11);
    const NoiseModel model{2.0, 0.5};
    Counts rows(basis.rows, std::vector<int32_t>(samples));
    for (int r = 0; r < basis.rows; ++r) {
        int lit = 0;
        for (int i = 0; i < basis.lamps; ++i) lit += basis.lit(r, i);
        const double mean = 100.0 * lit, sigma = model.read_counts + model.shot * std::sqrt(mean);
        std::normal_distribution<double> count(mean, sigma);
        for (auto& v : rows[r]) v = int32_t(std::lround(count(random)));
    }
    const std::vector<float> gain(samples, 0.5f);
    const auto lamps = demultiplexed(basis, rows, {gain, 0});
    double variance = 0;
    for (const auto& lamp : lamps)
        for (const float v : lamp) variance += (v - 50.0) * (v - 50.0) / double(samples * lamps.size());
    std::vector<float> estimate(samples);
    VarianceEstimate(basis, model).estimate(pointers(rows), samples, gain, estimate.data());
    const double mean_estimate = std::accumulate(estimate.begin(), estimate.end(), 0.0) / double(samples);
    EXPECT_NEAR(variance / mean_estimate, 1, 0.03);
}

// What breaks a multiplexed inversion: one saturated row spreads over all lamps, which is why masks travel.
TEST(DemultiplexMasks, a_clipped_row_disturbs_every_lamp) {
    const Basis basis = *find_basis("s159");
    const Counts lamps = random_lamps(basis.lamps, 1, 10, 60);
    Counts rows = multiplexed(basis, lamps);
    rows[40][0] -= 800;
    const auto back = demultiplexed(basis, rows);
    for (int i = 0; i < basis.lamps; ++i) EXPECT_FLOAT_EQ(std::abs(back[i][0] - float(lamps[i][0])), 10);
}
