// SPDX-License-Identifier: MIT
// Variance of a target: square roots in float and sums that rows share, beside the definition in double precision.
// links: ols_demultiplex
#include <algorithm>
#include <cmath>
#include <random>

#include "bench.hpp"
#include "demultiplex/variance.hpp"

using namespace ols;

namespace {

constexpr NoiseModel noise{};

// out = sum over rows of (mean over images of inverse(row, i)^2) noise(row)^2.
std::vector<double> by_definition(const Basis& basis, const std::vector<std::vector<int32_t>>& rows) {
    std::vector<double> sums(rows[0].size());
    for (int r = 0; r < basis.rows; ++r) {
        double squares = 0;
        for (int i = 0; i < basis.images(); ++i) squares += basis.inverse(r, i) * basis.inverse(r, i);
        for (size_t p = 0; p < sums.size(); ++p) {
            const double light = double(std::max(rows[size_t(r)][p], 0));
            const double sigma = noise.read_counts + noise.shot * std::sqrt(light);
            sums[p] += squares / basis.images() * sigma * sigma;
        }
    }
    return sums;
}

template <typename Count>
std::vector<const Count*> pointers(const std::vector<std::vector<Count>>& rows) {
    std::vector<const Count*> out;
    for (const auto& row : rows) out.push_back(row.data());
    return out;
}

}  // namespace

int main(int argc, char** argv) {
    Bench bench(
        argc, argv,
        {.name = "variance",
         .truth = "The variance of every lamp value of a target, 159 rows of s159 with 640 x 480 samples of 12 bits, "
                  "against the definition in double precision. On one core.",
         .advice = "Give 16-bit rows as the camera and the warp make them."});
    const size_t samples = bench.full() ? 640 * 480 : 1000;
    const Basis basis = *find_basis("s159");
    std::mt19937 random(3);
    std::vector<std::vector<int32_t>> longs;
    std::vector<std::vector<int16_t>> shorts;
    for (int r = 0; r < basis.rows; ++r) {
        longs.emplace_back();
        for (size_t p = 0; p < samples; ++p) longs.back().push_back(int32_t(random() % 4200) - 100);
        shorts.emplace_back(longs.back().begin(), longs.back().end());
    }
    const std::vector<double> truth = by_definition(basis, longs);
    std::vector<float> out(samples);
    const auto error = [&] {
        double squares = 0;
        for (size_t p = 0; p < samples; ++p) squares += std::pow(double(out[p]) / truth[p] - 1, 2);
        return 100 * std::sqrt(squares / double(samples));
    };
    const VarianceEstimate estimate(basis, noise);
    const auto from_longs = pointers(longs);
    const auto from_shorts = pointers(shorts);
    bench.measure(
        {.name = "precision",
         .set_by = "`VarianceEstimate`, by the rows it is given",
         .error_unit = "% rms",
         .peer = "double, by definition",
         .default_setting = "float, 16-bit rows",
         .settings = {
             {"double, by definition",
              [&] {
                  const auto sums = by_definition(basis, longs);
                  std::copy(sums.begin(), sums.end(), out.begin());
              },
              error},
             {"float, 32-bit rows", [&] { estimate.estimate(from_longs, samples, {}, out.data()); }, error},
             {"float, 16-bit rows", [&] { estimate.estimate(from_shorts, samples, {}, out.data()); }, error}}});
    return bench.finish();
}
