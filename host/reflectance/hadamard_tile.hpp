// SPDX-License-Identifier: MIT
// Hadamard tile: plays a plan over a few dozen samples in short integers, proves that none of them wrapped, and falls
// back to 32 bits where one did. SIMD by Highway, chosen at run time; every path gives the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "reflectance/hadamard_plan.hpp"
#include "reflectance/masked_sample.hpp"

namespace ols {

constexpr size_t tile_samples =
    64;  // one cache line pair of int16 a row; all of a plan's places fit the nearest caches

struct HadamardJob {
    const HadamardPlan* plan;
    const SumCode* code;
    // One of the two: a pointer a row.
    std::span<const int16_t* const> rows16;
    std::span<const int32_t* const> rows32;  // |counts| < 2^23
    // One of the two: a pointer a lamp. Sums are z itself; floats are z times factor.
    std::span<float* const> lamps;
    std::span<int32_t* const> sums;
    std::span<const float> factors;  // a sample each
    // Asked for the samples of every tile that has a masked one (masked_sample.hpp). Without it nothing is masked: the
    // lowest value is a count like any other, and no row is null.
    const SampleFiller* filler = nullptr;
};

struct TileCounts {
    uint64_t tiles = 0, fallbacks = 0, filled = 0;  // inverted; of these, in 32 bits; of all, with masked samples
};

// Scratch of one thread.
class TileScratch {
  public:
    explicit TileScratch(const SumCode& code);

    int16_t* short_places() { return places16_.data()->samples; }
    int32_t* long_places() { return places32_.data()->samples; }

  private:
    template <typename Sample>
    struct alignas(64) Place {
        Sample samples[tile_samples];
    };
    std::vector<Place<int16_t>> places16_;
    std::vector<Place<int32_t>> places32_;
};

// Inverts samples begin..end-1.
void invert_tiles(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts);

// Names of the SIMD paths that this processor has, best first; and the choice of one for what follows (tests, bench).
// Nothing chosen: the best.
std::vector<const char*> tile_paths();
void choose_tile_path(const char* name);

}  // namespace ols
