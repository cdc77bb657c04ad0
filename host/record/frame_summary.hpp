// SPDX-License-Identifier: MIT
// FrameSummary: what the optical code sees of a frame, block means above black, and how alike two of them are.
#pragma once

#include <array>

#include "image/frame.hpp"
#include "stage/stage.hpp"

namespace ols {

struct FrameSummary {
    static constexpr int grid = 8;
    std::array<float, grid * grid> blocks{};  // mean counts above black, row-major
    float noise = 0;                          // standard deviation of a block mean in the dark
};

// Sums over an 8 x 8 grid of equal blocks (the last row and column take what is left over), of a frame of at least 8 pixels a side whose
// rows come in their order. A sample that is not finite makes its block so.
class BlockSums {
  public:
    BlockSums() = default;
    explicit BlockSums(const Frame& frame);
    void add(const Frame& frame, uint32_t first_row, uint32_t rows, const std::byte* samples);

    // Of the means, once all rows were added.
    FrameSummary summary(double black_counts, const NoiseModel& noise) const;

  private:
    static constexpr size_t grid = FrameSummary::grid;
    size_t width_ = 0, height_ = 0, channels_ = 1;
    std::array<double, grid * grid> sums_{};
};

// Whether no block differs from black by more than six standard deviations of its mean and `black_drift_counts`, what
// the black level may wander between two calibrations.
bool is_dark(const FrameSummary& summary);
constexpr float black_drift_counts = 1;

// sum |a - b| / max(sum |a|, sum |b|): 0 for equal summaries, 1 when one is black, 2 for images of one
// brightness that share no lit block.
double difference(const FrameSummary& a, const FrameSummary& b);

}  // namespace ols
