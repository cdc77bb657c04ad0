// SPDX-License-Identifier: MIT
// Demultiplexing: from the images of a basis's rows to one image a lamp, with the masks they carry.
//
// Every call works on one sample plane (a mosaic is one plane; interleaved RGB is three calls). Samples are counts above
// black, signed: black is subtracted and never clamped, or the inversion would be biased.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "demultiplex/masked_sample.hpp"
#include "stage/basis.hpp"

namespace ols {

struct DemultiplexOptions {
    // Multiplied into every lamp value of a sample: from counts to r it is 1 / (F t) (docs/architecture.md). Empty: 1.
    std::span<const float> gain;
    int threads = 0;  // 0: as many as there are processors. Any number gives the same bits.
    // Asked for masked samples of rows of counts (masked_sample.hpp). Without it no sample is masked and no row null.
    const SampleFiller* filler = nullptr;
    // Taken off the lamps at last: a pointer each, to a value a sample. Empty: nothing is.
    std::span<const float* const> offsets = {};
};

// A basis made ready to be inverted, for who does it band after band. From any number of threads.
class Demultiplexer {
  public:
    explicit Demultiplexer(const Basis& basis);  // which must outlive it
    ~Demultiplexer();

    // lamps[i][p] = float(sum over rows of weight(row, i) * rows[row][p]) * float(basis.scale * gain[p]).
    // `rows` holds basis.rows pointers and `lamps` basis.images() pointers, each to `samples` values. The sum is exact when
    // |counts| < 2^23, which suits every camera of up to 16 bits. A basis without
    // integer weights: float(sum of inverse(row, i) * rows[row][p], in double) * gain[p].
    void invert(std::span<const int32_t* const> rows, size_t samples, std::span<float* const> lamps,
                const DemultiplexOptions& options = {}) const;
    // The same bits from 16-bit rows, as a camera or the warp makes them: by a plan in less time, for nothing is narrowed.
    // Either way lamps that begin at a multiple of 64 bytes are written past the caches, which takes a quarter of the time of
    // others; so are those of a basis whose rows are images of their own.
    void invert(std::span<const int16_t* const> rows, size_t samples, std::span<float* const> lamps,
                const DemultiplexOptions& options = {}) const;
    // The same for sources that do not quantise: sums in double. Here and without integer weights the order of a sum is the
    // matrix library's, so that the last bits depend on its version and the processor.
    void invert(std::span<const float* const> rows, size_t samples, std::span<float* const> lamps,
                const DemultiplexOptions& options = {}) const;

  private:
    struct Ready;
    std::unique_ptr<Ready> ready_;
};

// For one call.
inline void demultiplex(const Basis& basis, std::span<const int32_t* const> rows, size_t samples,
                        std::span<float* const> lamps, const DemultiplexOptions& options = {}) {
    Demultiplexer(basis).invert(rows, samples, lamps, options);
}
inline void demultiplex(const Basis& basis, std::span<const int16_t* const> rows, size_t samples,
                        std::span<float* const> lamps, const DemultiplexOptions& options = {}) {
    Demultiplexer(basis).invert(rows, samples, lamps, options);
}
inline void demultiplex(const Basis& basis, std::span<const float* const> rows, size_t samples,
                        std::span<float* const> lamps, const DemultiplexOptions& options = {}) {
    Demultiplexer(basis).invert(rows, samples, lamps, options);
}

}  // namespace ols
