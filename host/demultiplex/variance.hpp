// SPDX-License-Identifier: MIT
// Variance: what the camera's noise becomes in the lamps of a basis, sample by sample.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stage/basis.hpp"
#include "stage/stage.hpp"

namespace ols {

// The variance of a lamp value at each sample, mean over lamps, when the noise of a row's count y is
// (read + shot sqrt(max(y, 0)))^2 and independent from row to row:
// out[p] = gain[p]^2 sum over rows of (mean over images of inverse(row, i)^2) noise(rows[row][p])^2.
//
// A masked sample, or a row that is lost (null), is taken to have the mean noise variance of the sample's other rows; where all are
// masked, that of a count of 0. What its filling costs in noise is RowFill::noise_gain, which multiplies this.
//
// In float, |counts| < 2^23; all terms are positive, and the relative error is below (rows + 16) 2^-24. Made once for a basis; the
// calls may come from any thread.
class VarianceEstimate {
  public:
    VarianceEstimate(const Basis& basis, const NoiseModel& noise);

    // `rows` holds basis.rows pointers, to `samples` counts each; an empty `gain` is 1.
    void estimate(std::span<const int32_t* const> rows, size_t samples, std::span<const float> gain, float* out) const;
    void estimate(std::span<const int16_t* const> rows, size_t samples, std::span<const float> gain, float* out) const;

  private:
    // Rows of one weight share their sums of counts and of square roots.
    struct RowClass {
        double weight;  // mean over images of inverse(row, i)^2
        std::vector<int> rows;
    };
    template <typename Count>
    class Block;
    template <typename Count>
    void estimate_all(std::span<const Count* const> rows, size_t samples, std::span<const float> gain,
                      float* out) const;

    NoiseModel noise_;
    std::vector<RowClass> classes_;
    int row_count_;
};

}  // namespace ols
