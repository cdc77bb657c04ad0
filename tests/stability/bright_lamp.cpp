// SPDX-License-Identifier: MIT
// One lamp a thousand times brighter than the rest stands in half of all rows: the others are small differences of large
// sums.
// links: ols_demultiplex Eigen3::Eigen
#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>

#include "demultiplex/demultiplex.hpp"
#include "hard_case.hpp"

using namespace ols;

namespace {

// Lamp b of sample b has 3000 counts, the others 3: samples of a 12-bit camera, which no row saturates.
constexpr int bright = 3000, dim = 3;

int count_of(int lamp, int sample) {
    return lamp == sample ? bright : dim;
}

std::vector<std::vector<int32_t>> row_counts(const Basis& basis) {
    std::vector<std::vector<int32_t>> rows(size_t(basis.rows), std::vector<int32_t>(size_t(basis.lamps)));
    for (int r = 0; r < basis.rows; ++r)
        for (int p = 0; p < basis.lamps; ++p)
            for (int i = 0; i < basis.lamps; ++i) rows[size_t(r)][size_t(p)] += basis.lit(r, i) ? count_of(i, p) : 0;
    return rows;
}

// The largest error of a dim lamp, relative.
template <typename Value>
double dim_error(const Basis& basis, double unit, const Value& value) {
    double worst = 0;
    for (int i = 0; i < basis.lamps; ++i)
        for (int p = 0; p < basis.lamps; ++p)
            if (i != p) worst = std::max(worst, std::abs(double(value(i, p)) * unit / dim - 1));
    return worst;
}

}  // namespace

// Naive: counts are turned into reflectance, as float, and multiplied by the float inverse (sgemm): every row is rounded at the
// bright lamp's size. Bound: our sum of counts is an exact integer (240 for a dim lamp), which leaves the rounding of the factor
// scale * gain and of its product with the sum, 2^-24 each, and that of the gain before, 2^-24: (1 + 2^-24)^3 - 1.
TEST(BrightLamp, does_not_cost_the_others_their_digits) {
    const Basis basis = *find_basis("s159");
    const auto rows = row_counts(basis);
    const size_t samples = rows[0].size();
    const double unit = 1038.24;  // counts of r = 1
    std::vector<float> gain(samples, float(1 / unit));
    std::vector<std::vector<float>> lamps(size_t(basis.lamps), std::vector<float>(samples));
    std::vector<const int32_t*> in;
    std::vector<float*> out;
    for (const auto& row : rows) in.push_back(row.data());
    for (auto& lamp : lamps) out.push_back(lamp.data());
    demultiplex(basis, in, samples, out, {gain, 1});

    Eigen::MatrixXf inverse(basis.lamps, basis.rows), reflectance(basis.rows, Eigen::Index(samples));
    for (int r = 0; r < basis.rows; ++r) {
        for (int i = 0; i < basis.lamps; ++i) inverse(i, r) = float(basis.inverse(r, i));
        for (size_t p = 0; p < samples; ++p) reflectance(r, Eigen::Index(p)) = float(rows[size_t(r)][p]) * gain[p];
    }
    const Eigen::MatrixXf product = inverse * reflectance;
    const double naive = dim_error(basis, unit, [&](int i, int p) { return product(i, p); });
    const double ours = dim_error(basis, unit, [&](int i, int p) { return lamps[size_t(i)][size_t(p)]; });
    expect_within("one lamp a thousand times brighter: relative error of the others", naive, ours,
                  std::pow(1 + 0x1p-24, 3) - 1, "");
}

// Bound: 0, for the sums are exact integers.
TEST(BrightLamp, wraps_int16_and_ours_does_not) {
    const Basis basis = *find_basis("s159");
    const auto rows = row_counts(basis);
    const size_t samples = rows[0].size();
    const std::vector<float> gain(samples, float(1 / basis.scale));  // floats hold the sums themselves
    std::vector<std::vector<float>> lamps(size_t(basis.lamps), std::vector<float>(samples));
    std::vector<const int32_t*> in;
    std::vector<float*> out;
    for (const auto& row : rows) in.push_back(row.data());
    for (auto& lamp : lamps) out.push_back(lamp.data());
    demultiplex(basis, in, samples, out, {gain, 1});
    double naive = 0, ours = 0;
    for (int i = 0; i < basis.lamps; ++i)
        for (size_t p = 0; p < samples; ++p) {
            uint16_t sum = 0;
            for (int r = 0; r < basis.rows; ++r) sum = uint16_t(sum + basis.weight(r, i) * rows[size_t(r)][p]);
            const double truth = count_of(i, int(p));
            naive = std::max(naive, std::abs(double(int16_t(sum)) * basis.scale - truth));
            ours = std::max(ours, std::abs(double(lamps[size_t(i)][p]) / 80 - truth));
        }
    expect_within("one lamp a thousand times brighter, in int16", naive, ours, 0, "counts");
}
