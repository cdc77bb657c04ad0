// SPDX-License-Identifier: MIT
// The variance estimate against its definition in double precision, for rows of both widths, masked and lost ones included.
// links: ols_demultiplex
#include "demultiplex/variance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "demultiplex/masked_sample.hpp"

using namespace ols;

namespace {

constexpr NoiseModel noise{2.68, 0.492};

template <typename Count>
std::vector<std::vector<Count>> random_rows(int rows, size_t samples, int least, int most) {
    std::mt19937 random(4);
    std::uniform_int_distribution<int> value(least, most);
    std::vector<std::vector<Count>> out;
    out.resize(size_t(rows), std::vector<Count>(samples));
    for (auto& row : out)
        for (auto& count : row) count = Count(value(random));
    return out;
}

// Mean over images of inverse(row, i)^2.
std::vector<double> row_weights(const Basis& basis) {
    std::vector<double> weights;
    for (int r = 0; r < basis.rows; ++r) {
        double squares = 0;
        for (int i = 0; i < basis.images(); ++i) squares += basis.inverse(r, i) * basis.inverse(r, i);
        weights.push_back(squares / basis.images());
    }
    return weights;
}

// By definition: a masked count has the mean noise variance of the others.
template <typename Count>
double truth(const std::vector<double>& weights, const std::vector<const Count*>& rows, size_t p, double gain) {
    double sum = 0, masked_weight = 0, variances = 0;
    int shown = 0;
    for (size_t r = 0; r < rows.size(); ++r) {
        const double weight = weights[r];
        if (!rows[r] || rows[r][p] == masked_sample<Count>) {
            masked_weight += weight;
            continue;
        }
        const double y = std::max(0.0, double(rows[r][p]));
        const double variance = std::pow(noise.read_counts + noise.shot * std::sqrt(y), 2);
        sum += weight * variance;
        variances += variance;
        ++shown;
    }
    const double mean = shown ? variances / shown : noise.read_counts * noise.read_counts;
    return gain * gain * (sum + masked_weight * mean);
}

template <typename Count>
void expect_true(const Basis& basis, const std::vector<const Count*>& rows, size_t samples) {
    std::vector<float> gain, out(samples);
    for (size_t p = 0; p < samples; ++p) gain.push_back(0.001f * float(p % 7 + 1));
    VarianceEstimate(basis, noise).estimate(rows, samples, gain, out.data());
    const std::vector<double> weights = row_weights(basis);
    const double bound = (basis.rows + 16) * std::ldexp(1.0, -24);
    for (size_t p = 0; p < samples; p += p % 3 + 1) {
        const double wanted = truth(weights, rows, p, double(gain[p]));
        ASSERT_NEAR(out[p], wanted, bound * wanted) << p;
    }
}

template <typename Count>
std::vector<const Count*> pointers(const std::vector<std::vector<Count>>& rows) {
    std::vector<const Count*> out;
    for (const auto& row : rows) out.push_back(row.data());
    return out;
}

class Variance : public testing::TestWithParam<std::string> {
  protected:
    const Basis basis = *find_basis(GetParam());
};
INSTANTIATE_TEST_SUITE_P(, Variance, testing::Values("single", "triangle300", "s159", "hadamard156", "paley163"));

TEST_P(Variance, of_16_bit_rows_is_what_its_definition_says) {
    const auto rows = random_rows<int16_t>(basis.rows, 530, -200, 32767);
    expect_true(basis, pointers(rows), 530);
}

TEST_P(Variance, of_32_bit_rows_is_what_its_definition_says) {
    const auto rows = random_rows<int32_t>(basis.rows, 100, -1000, (1 << 23) - 1);
    expect_true(basis, pointers(rows), 100);
}

TEST_P(Variance, of_masked_counts_and_lost_rows_is_the_mean_of_the_others) {
    auto rows = random_rows<int16_t>(basis.rows, 600, -50, 4095);
    std::mt19937 random(6);
    for (int i = 0; i < 200; ++i) rows[random() % rows.size()][random() % 500] = masked_sample<int16_t>;
    for (auto& row : rows) row[7] = masked_sample<int16_t>;
    auto given = pointers(rows);
    given[3] = nullptr;
    expect_true(basis, given, 600);
}

TEST(VarianceOfNothing, is_that_of_the_read_noise) {
    const Basis basis = *find_basis("s159");
    expect_true(basis, std::vector<const int16_t*>(size_t(basis.rows)), 40);
}

}  // namespace
