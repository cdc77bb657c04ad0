// SPDX-License-Identifier: MIT
// Masked samples: how a sample without a count (saturated, lost) travels in a row, and who puts a value in its place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

namespace ols {

// In-band, so that a row stays one plane of one type: the lowest value of an integer type, which no camera's count above
// black is, and NaN in rows of floats. A row of which every sample is masked (a lost slot) is a null pointer.
template <typename Sample>
constexpr Sample masked_sample = std::numeric_limits<Sample>::lowest();
template <>
inline constexpr float masked_sample<float> = std::numeric_limits<float>::quiet_NaN();

template <typename Sample>
bool is_masked(Sample sample) {
    if constexpr (std::numeric_limits<Sample>::has_quiet_NaN) return sample != sample;
    return sample == masked_sample<Sample>;
}

// Fills the masked samples of a tile before it is inverted. Called from several threads at once, for tiles in any order:
// what it writes may depend on nothing but the tile.
class SampleFiller {
  public:
    virtual ~SampleFiller() = default;

    // tile[row * tile_samples + i], i < count, are the counts of all rows at sample begin + i of the job, one of them
    // masked_sample<int32_t> at least. Every masked one is to be replaced by a count, |count| < 2^23; the others are not
    // to change.
    virtual void fill(int32_t* tile, size_t begin, size_t count) const = 0;
};

}  // namespace ols
