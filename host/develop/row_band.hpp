// SPDX-License-Identifier: MIT
// Row band: one colour of a band of pixel rows, calibrated and aligned, for every row of the basis.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "image/frame.hpp"
#include "image/plane.hpp"
#include "image/target.hpp"
#include "stage/calibration.hpp"

namespace ols {

// The frames that show each row of the basis: as many as serve it, none where it was lost.
using RowFrames = std::vector<std::vector<std::shared_ptr<const Frame>>>;

// Which samples of the frames: pixel rows first_row ... of one channel.
struct Band {
    size_t first_row = 0, rows = 0, width = 0;
    int channel = 0, channels = 1;

    size_t samples() const { return rows * width; }
    size_t first_pixel() const { return first_row * width; }
};

// Sum: int16_t or int32_t for frames of counts, float for frames of floats.
template <typename Sum>
class RowBand {
  public:
    // Samples are not set; all else is 0.
    RowBand(size_t rows, size_t samples);

    size_t rows() const { return rows_; }
    // Counts above black; masked_sample<Sum> where there is none.
    Sum* row(size_t r) { return samples_.data() + r * pitch_; }
    const Sum* row(size_t r) const { return samples_.data() + r * pitch_; }

    // Of each sample: MaskBit of what was left out of it, in any row (mask_saturated, mask_missing); 0 where all is there.
    std::vector<uint8_t> masked;
    std::vector<float> black_rest;  // of each sample: what is left of the black level in every row, |rest| <= 0.5
    std::vector<float> white;       // of each sample: the count above black at which it saturates
    // Of each sample, padded to a multiple of 16: what the variance of its noise differs from a recorded count's, summed over the
    // rows, as a share of it; empty where nothing was blended.
    std::vector<float> noise;

  private:
    size_t rows_, pitch_;
    std::vector<Sum, PlaneAllocator<Sum>> samples_;
};

// The rows of a basis as they were recorded: the mean of each row's frames, rounded to whole counts for integers, without
// samples at or above white or not finite; a sample that no frame has is masked. int16_t only where fits_shorts()
// (develop/signal_planes.hpp).
template <typename Summed>
struct RecordedRows {
    using Sum = Summed;
    RowFrames rows;

    // `like`: any of the frames. With `clipped_stay` saturated samples count like others, marked all the same.
    RowBand<Sum> load(const Band& band, const Frame& like, const Image& black, bool clipped_stay) const;
};

}  // namespace ols
