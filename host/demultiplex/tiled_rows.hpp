// SPDX-License-Identifier: MIT
// Tiled rows: the frames of a cycle, stored as they arrive so that the samples which are inverted together lie together.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "demultiplex/planes.hpp"

namespace ols {

// Tile by tile, the samples of row 0, row 1, ...: 159 rows of a tile are 10 KB, read from the first to the last byte,
// where plain images would be read at 159 places at once. Storing a frame costs the one pass over it that subtracting black costs anyway.
class TiledRows {
  public:
    TiledRows(int rows, size_t samples);

    // Row `row` becomes counts - black, or masked_sample where counts >= white. `counts` and `black` have a value a
    // sample; every count below `white` less its black fits 16 bits. Count: uint8_t or uint16_t.
    template <typename Count>
    void write(int row, std::span<const Count> counts, std::span<const int16_t> black, int white);

    Planes<const int16_t> planes() const { return {first_, size_t(rows_) * tile_samples}; }

  private:
    struct alignas(64) Tile {
        int16_t samples[tile_samples];
    };
    int rows_;
    size_t samples_;
    std::vector<Tile> tiles_;  // of all rows at the first samples, then of all rows at the next
    std::vector<const int16_t*> first_;
};

}  // namespace ols
