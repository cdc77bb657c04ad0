// SPDX-License-Identifier: MIT
// Followed brightness: what a point's brightness under all lamps says of samples that were taken while it was another one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "capture/align.hpp"
#include "image/plane.hpp"
#include "stage/stage.hpp"

namespace ols {

// Where alignment finds no counterpart (a lid that opens, an outline that moves, a shadow that passes), a pixel's samples show
// something of another brightness than the target does. The tracking frames, aligned like the samples, tell how much: a sample
// taken while the pixel had the brightness T under all lamps is multiplied by T0 / T, T0 the target's own. That is exact
// where what is seen at both moments differs in albedo alone; else the sum over all lamps is right and its share among them is
// that of the other moment. Our own addition to Wenger section 6, after the quotients of Peers et al. 2007.
//
// T between two tracking frames is linear in time. Samples stay to the bit where T and T0 differ by less than six standard
// deviations of the camera's noise in their difference, and where either is not known. The factor stays within 1/4 and 4,
// as the sample's noise is multiplied with it.
class FollowedBrightness {
  public:
    // By knot of the alignment: a band of the tracking frame's samples, brought to the target, in counts above black.
    template <typename Sum>
    using Knots = std::vector<std::vector<Sum, PlaneAllocator<Sum>>>;

    // `instant`: the target's knot.
    template <typename Sum>
    FollowedBrightness(const Knots<Sum>& knots, size_t instant, const NoiseModel& noise);

    // `samples`: the same band of a slot, brought to the target. Masked ones stay.
    template <typename Sum>
    void apply(const Alignment::Place& place, std::span<Sum> samples) const;

  private:
    struct Change {
        uint32_t sample;
        float first, last;  // T at the interval's ends
        float now, least;   // T0, and the difference that counts
    };
    std::vector<std::vector<Change>> changes_;  // by interval: the samples that may change within
};

}  // namespace ols
