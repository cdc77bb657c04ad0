// SPDX-License-Identifier: MIT
// Signal planes: a frame's samples above black, ready to be interpolated.
#pragma once

#include <vector>

#include "develop/group_motion.hpp"
#include "image/frame.hpp"
#include "image/plane.hpp"

namespace ols {

// The grid of a frame's samples: a colour of a mosaic has every second column and row.
SampleGrid sample_grid(int width, int height, Cfa cfa);

// The samples of one channel, row by row, and beyond each edge some columns and rows that repeat it, each colour of a mosaic its
// own edge: what moved in from outside takes the edge.
template <typename Sample>
class MarginedPlane {
  public:
    static constexpr int margin = 16;

    explicit MarginedPlane(const SampleGrid& grid);

    const SampleGrid& grid() const { return grid_; }
    size_t pitch() const { return pitch_; }
    // From the first sample of row y; y may lie in the margin.
    Sample* row(int y) { return samples_.data() + size_t(y + margin) * pitch_ + margin; }
    const Sample* row(int y) const { return samples_.data() + size_t(y + margin) * pitch_ + margin; }
    void fill_margin();  // from the samples within

  private:
    SampleGrid grid_;
    size_t pitch_;
    std::vector<Sample, PlaneAllocator<Sample>> samples_;
};

// Sample: int16_t, for cameras whose white is 16383 counts at most, or float.
template <typename Sample>
struct SignalPlanes {
    using Channels = std::vector<MarginedPlane<Sample>>;
    Channels channels;  // one of a mosaic, as it lies, or a monochrome frame; three of rgb
    bool any_masked = false;
    Channels clipped;  // if kept, and any is masked: the same, but what saturated is there, a lower bound
    int largest = 0;   // |sample| at most, of cameras that count
};

// Whether counts up to `white` above this black fit SignalPlanes<int16_t>.
bool fits_shorts(PixelFormat format, float white, const Image& black);

// What is taken off the samples: of a camera that counts the whole part of black (row_band.hpp), else all of it.
template <typename Sample>
SignalPlanes<Sample> black_planes(const Image& black, Cfa cfa, PixelFormat format);

// Samples less `black`, masked_sample<Sample> where one is at or above white or not finite. int16_t only where
// fits_shorts().
template <typename Sample>
SignalPlanes<Sample> signal_planes(const Frame& frame, const SignalPlanes<Sample>& black, bool keeps_clipped);

}  // namespace ols
