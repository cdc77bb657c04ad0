// SPDX-License-Identifier: MIT
// Hadamard tile: plays a plan over a few dozen samples in short integers, proves that none of them wrapped, and falls
// back to 32 bits where one did. SIMD by Highway, chosen at run time; every path gives the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "demultiplex/hadamard_plan.hpp"
#include "demultiplex/masked_sample.hpp"
#include "demultiplex/planes.hpp"

namespace ols {

struct HadamardJob {
    const HadamardPlan* plan;
    // One of the two, a plane a row of the basis.
    Planes<const int16_t> rows16 = {};
    Planes<const int32_t> rows32 = {};  // |counts| < 2^23
    // Any of these, a plane a lamp:
    Planes<int32_t> sums = {};     // z itself
    Planes<int16_t> shorts = {};   // z, the nearest there is where it does not fit; TileCounts::clipped counts these
    Planes<float> floats = {};     // z times factor, less offset
    Planes<uint16_t> halves = {};  // the same as IEEE half, to the nearest even; infinite from 65520
    std::span<const float> factors = {};         // one a sample, for floats and halves
    std::span<const float* const> offsets = {};  // a pointer a lamp, to one a sample; empty: none
    // Asked for the samples of every tile that has a masked one (masked_sample.hpp). Without it nothing is masked: the
    // lowest value is a count like any other, and no row is null.
    const SampleFiller* filler = nullptr;
};

struct TileCounts {
    uint64_t tiles = 0, fallbacks = 0, filled = 0;  // inverted; of these, in 32 bits; of all, with masked samples
    uint64_t clipped = 0;                           // values of `shorts`
};

// Scratch of one thread.
class TileScratch {
  public:
    explicit TileScratch(const HadamardPlan& plan);

    int16_t* short_places() { return short_places_.data()->samples; }
    int32_t* long_places() { return long_places_.data()->samples; }
    int16_t* copied_rows() { return copied_rows_.data()->samples; }

  private:
    template <typename Sample>
    struct alignas(64) Place {
        Sample samples[tile_samples];
    };
    std::vector<Place<int16_t>> short_places_, copied_rows_;
    std::vector<Place<int32_t>> long_places_;
};

// Inverts samples begin..end-1; `begin` is a multiple of tile_samples.
void invert_tiles(const HadamardJob& job, size_t begin, size_t end, TileScratch& scratch, TileCounts& counts);

// Names of the SIMD paths that this processor has, best first; and the choice of one for what follows (tests, bench).
// Nothing chosen: the best.
std::vector<const char*> tile_paths();
void choose_tile_path(const char* name);

}  // namespace ols
