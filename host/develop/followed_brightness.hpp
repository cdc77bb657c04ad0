// SPDX-License-Identifier: MIT
// Followed brightness: what a point's brightness under all lamps says of samples that were taken while it was another one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "develop/align.hpp"
#include "develop/row_band.hpp"
#include "stage/stage.hpp"

namespace ols {

// The tracking frames that tell brightness, in order.
struct BrightnessKnots {
    std::vector<double> ticks;  // middles of their exposures
    std::vector<float> light;   // relative_light()
    size_t instant = 0;         // the target's own
};

// Of each knot, how bright its frame was lit, relative to the target's own, 1 of itself: the median over the pixels that stand
// at least ten standard deviations of their noise above black in both, which those that changed do not move much. 1 where
// these are fewer than 64. `bands`: parts of the frames, a row for each knot, brought to the target.
template <typename Sum>
std::vector<float> relative_light(std::span<const RowBand<Sum>> bands, size_t instant, const NoiseModel& noise);

// Where alignment finds no counterpart (a lid that opens, an outline that moves, a shadow that passes), a pixel's samples show
// something of another brightness than the target does. The tracking frames, aligned like the samples, tell how much: a sample
// taken while the pixel had the brightness T under all lamps is multiplied by T0 / T, T0 the target's own. That is exact
// where what is seen at both moments differs in albedo alone; else the sum over all lamps is right and its share among them is
// that of the other moment. Our own addition to Wenger section 6, after the quotients of Peers et al. 2007.
//
// Light that all pixels have more or less of is the lamps' in the tracking slots, not the subject's: it is taken out before.
//
// It mends interpolation, too: what a warp smears in the sample it smears in T.
//
// Of the difference d = T0 - T, noise is likely to be a part: at a tracking frame's time samples are multiplied by
// 1 + g (T0 / T - 1) with g = 1 - (n / d)^2, and not at all where |d| <= n; n is 1.5 standard deviations of the camera's noise in d,
// 6 where nothing moves, so that there hardly a sample is touched for nothing. With one standard deviation that is the Wiener
// filter's gain. In between the factor's inverse is linear in time, as T is. Samples stay to the bit where it is 1, and it is 1
// where T or T0 is not known. T0 / T stays within 1/4 and 4, as the sample's noise is multiplied with it.
template <typename Sum>
class FollowedBrightness {
  public:
    // `rows`: the same band as the samples; of each knot its frame's samples brought to the target, in counts above black.
    // `moves`: of each sample, not 0 where it moves (Alignment::moves()).
    FollowedBrightness(const RowBand<Sum>& rows, const BrightnessKnots& knots, const NoiseModel& noise,
                       std::span<const uint8_t> moves);

    // A slot's samples in the band, brought to the target, padded to a multiple of 16; `tick`: the middle of its exposure. Before
    // the first knot and after the last their factors stay. Masked samples stay. Integers are rounded, half away from zero, and
    // held to what the inversion takes: 16383 of shorts, 2^23 - 1 of others. The same bits on every SIMD path.
    void apply(double tick, Sum* samples) const;

  private:
    std::vector<double> ticks_;                  // of the knots
    std::vector<std::vector<float>> divisors_;   // by knot, of each sample: the factor's inverse
    std::vector<std::vector<uint32_t>> blocks_;  // between two knots: blocks of samples of which some may change
};

}  // namespace ols
