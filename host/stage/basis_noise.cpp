// SPDX-License-Identifier: MIT
// Propagation of slot noise through an inversion.
#include "stage/basis_noise.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace ols {

namespace {

double row_counts(const Basis& basis, int row, std::span<const double> lamp_counts) {
    assert(int(lamp_counts.size()) == basis.lamps);
    double counts = 0;
    for (int lamp = 0; lamp < basis.lamps; ++lamp) counts += basis.light(row, lamp) * lamp_counts[size_t(lamp)];
    return counts;
}

}  // namespace

double noise_variance_at(const NoiseModel& noise, double counts) {
    const double sigma = noise.read_counts + noise.shot * std::sqrt(std::max(counts, 0.0));
    return sigma * sigma;
}

std::vector<double> image_variances(const Basis& basis, std::span<const double> lamp_counts, const NoiseModel& noise) {
    std::vector<double> variances(size_t(basis.images()));
    for (int row = 0; row < basis.rows; ++row) {
        const double variance = noise_variance_at(noise, row_counts(basis, row, lamp_counts));
        for (int image = 0; image < basis.images(); ++image) {
            const double weight = basis.inverse(row, image);
            variances[size_t(image)] += weight * weight * variance;
        }
    }
    return variances;
}

double brightest_row_counts(const Basis& basis, std::span<const double> lamp_counts) {
    double brightest = 0;
    for (int row = 0; row < basis.rows; ++row) brightest = std::max(brightest, row_counts(basis, row, lamp_counts));
    return brightest;
}

}  // namespace ols
