// SPDX-License-Identifier: MIT
// The grid, and the noise of what lies on it.
#include "develop/parity_samples.hpp"

#include <algorithm>
#include <cmath>

#include "demultiplex/masked_sample.hpp"

namespace ols {

namespace {

// Grid lines of `step` in `extent`, the first half a step from the edge.
int lines_of(int step, int extent) {
    return extent <= step / 2 ? 0 : (extent - step / 2 - 1) / step + 1;
}

}  // namespace

ParitySamples::ParitySamples(int step, int width, int height, int channels, int rows)
    : step_(step),
      columns_(lines_of(step, width)),
      lines_(lines_of(step, height)),
      counts_(rows, Eigen::Index(columns_) * lines_ * channels),
      variance_(counts_.cols()) {}

int ParitySamples::strip_of(size_t sample, int strips) const {
    return int(sample % size_t(columns_ * lines_)) / columns_ * strips / lines_;
}

// The noise of a row's count, (read + shot sqrt y)^2, is concave in y: taken at the mean over the rows, which has little noise of its
// own, it is right to 1 % for counts that spread by a third, and too large for others.
template <typename Sum>
void ParitySamples::gather(const RowBand<Sum>& loaded, const Band& band, const NoiseModel& noise,
                           std::span<const int> lost_rows) {
    constexpr double rounding = std::is_integral_v<Sum> ? 1 / 12.0 : 0;  // counts^2, of whole counts
    const auto rows = Eigen::Index(loaded.rows());
    for (size_t y = 0; y < band.rows; ++y) {
        const int from_first = int(band.first_row + y) - step_ / 2;
        if (from_first < 0 || from_first % step_ != 0) continue;
        const Eigen::Index first = Eigen::Index((band.channel * lines_ + from_first / step_)) * columns_;
        for (Eigen::Index k = 0; k < columns_; ++k) {
            const size_t p = y * band.width + size_t(step_ / 2 + int(k) * step_);
            auto counts = counts_.col(first + k);
            bool is_masked_here = false;
            for (Eigen::Index row = 0; row < rows; ++row) {
                const Sum count = loaded.row(size_t(row))[p];
                counts(row) = is_masked(count) ? 0 : float(count) - loaded.black_rest[p];
                is_masked_here |= is_masked(count) && !std::ranges::binary_search(lost_rows, int(row));
            }
            const double mean = double(counts.sum()) / double(rows - Eigen::Index(lost_rows.size()));
            // Less its own deviation in the dark, or the root of what is but noise would count.
            const double light = mean - noise.read_counts / std::sqrt(double(rows));
            const double sigma = noise.read_counts + noise.shot * std::sqrt(std::max(light, 0.0));
            const double recorded = loaded.noise.empty() ? 1 : 1 + double(loaded.noise[p]) / double(rows);
            variance_(first + k) = is_masked_here ? 0 : float(sigma * sigma * recorded + rounding);
        }
    }
}

template void ParitySamples::gather(const RowBand<int16_t>&, const Band&, const NoiseModel&, std::span<const int>);
template void ParitySamples::gather(const RowBand<int32_t>&, const Band&, const NoiseModel&, std::span<const int>);
template void ParitySamples::gather(const RowBand<float>&, const Band&, const NoiseModel&, std::span<const int>);

}  // namespace ols
