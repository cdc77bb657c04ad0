// SPDX-License-Identifier: MIT
// Parity samples: the rows of a basis at an even grid of samples, as they are inverted, for checks of the whole (parity_witness.hpp).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "develop/row_band.hpp"
#include "stage/stage.hpp"

namespace ols {

// Every `step`th column of every `step`th pixel row, of each channel; an odd step takes all colours of a mosaic in turn.
class ParitySamples {
  public:
    ParitySamples(int step, int width, int height, int channels, int rows);

    // What of a band lies on the grid. Bands may come from several threads at once.
    template <typename Sum>
    void gather(const RowBand<Sum>& loaded, const Band& band, const NoiseModel& noise, std::span<const int> lost_rows);

    int step() const { return step_; }
    size_t size() const { return size_t(counts_.cols()); }
    // Counts above black, less its rest; rows x samples. Of rows that are lost 0.
    const Eigen::MatrixXf& counts() const { return counts_; }
    // Of each sample the variance of its noise, mean over the rows; 0 where one that is not lost is masked.
    const Eigen::ArrayXf& variance() const { return variance_; }
    // Which of so many horizontal strips of the picture a sample is in.
    int strip_of(size_t sample, int strips) const;

  private:
    const int step_, columns_, lines_;
    Eigen::MatrixXf counts_;
    Eigen::ArrayXf variance_;
};

}  // namespace ols
