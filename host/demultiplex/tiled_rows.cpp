// SPDX-License-Identifier: MIT
// Where tiles lie, and how counts get there.
#include "demultiplex/tiled_rows.hpp"

#include <algorithm>
#include <cassert>

#include "demultiplex/masked_sample.hpp"

namespace ols {

TiledRows::TiledRows(int rows, size_t samples)
    : rows_(rows), samples_(samples), tiles_((samples + tile_samples - 1) / tile_samples * size_t(rows)) {
    for (int row = 0; row < rows; ++row) first_.push_back(tiles_[size_t(row)].samples);
}

template <typename Count>
void TiledRows::write(int row, std::span<const Count> counts, std::span<const int16_t> black, int white) {
    assert(row >= 0 && row < rows_ && counts.size() == samples_ && black.size() == samples_);
    for (size_t begin = 0; begin < samples_; begin += tile_samples) {
        int16_t* const to = tiles_[begin / tile_samples * size_t(rows_) + size_t(row)].samples;
        for (size_t i = 0; i < std::min(tile_samples, samples_ - begin); ++i) {
            const int count = counts[begin + i], above_black = count - black[begin + i];
            assert(count >= white || above_black == int16_t(above_black));
            to[i] = count >= white ? masked_sample<int16_t> : int16_t(above_black);
        }
    }
}

template void TiledRows::write(int, std::span<const uint8_t>, std::span<const int16_t>, int);
template void TiledRows::write(int, std::span<const uint16_t>, std::span<const int16_t>, int);

}  // namespace ols
