// SPDX-License-Identifier: MIT
// Aligned rows: the rows of a basis, each from frames of its own times, as they would have been at the target's.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "develop/align.hpp"
#include "develop/followed_brightness.hpp"
#include "develop/row_band.hpp"
#include "develop/signal_planes.hpp"
#include "develop/slot_interpolation.hpp"

namespace ols {

// Sample: of the planes that are warped. Sum: of the rows; from float samples to int32_t they are rounded, half away from
// zero.
template <typename Sample, typename Summed>
struct AlignedRows {
    using Sum = Summed;
    struct Recorded {
        std::shared_ptr<const SignalPlanes<Sample>> planes;
        Alignment::Place place;
    };
    // The same slot's frame across the target.
    struct Across {
        Recorded recorded;
        std::shared_ptr<const std::vector<float>> trust;  // trust_across()
        float share;                                      // of the nearer one
    };
    struct Source {
        Recorded nearer;
        std::optional<Across> across = {};
    };
    std::vector<std::vector<Source>> rows;  // by basis row; none where it was lost
    std::shared_ptr<const Alignment> alignment;
    // Whether samples of pixels that are not trusted are masked, for an estimate with a prior to fill in. Otherwise they stay as they
    // are: rows that lost a whole group of slots determine no lamp.
    bool masks_untrusted = false;
    // The tracking frames, a row each, whose brightness samples follow; null: they do not.
    std::shared_ptr<const AlignedRows> tracking;
    BrightnessKnots knots;  // these
    NoiseModel noise;       // of the camera

    // The mean of each row's frames. `like`: a frame of the take. With `clipped_stay` saturated samples count like others,
    // marked all the same.
    // Marks mask_saturated, mask_missing where the row was lost, and mask_misaligned with `masks_untrusted`. What motion leads to
    // outside the frame takes the frame's edge, and is not marked: confidence() says that it is not trusted.
    RowBand<Sum> load(const Band& band, const Frame& like, const Image& black, bool clipped_stay) const;

    // Of each pixel, the least of all intervals that the nearer frames are taken from.
    std::vector<float> confidence() const;

    size_t blended_sources() const;  // that have a frame across

  private:
    // A band on its way.
    struct Loading {
        const Band& band;
        bool clipped_stay;
        const FollowedBrightness<Sum>* brightness;  // may be null
        RowBand<Sum>& loaded;
        std::vector<Sum, PlaneAllocator<Sum>> beside;  // as long as a row
    };
    // The nearer frame whose turn is after that of a row's source; null where there is none.
    const Recorded* loaded_after(size_t row, size_t source) const;
    // `next`: what is loaded after it; may be null.
    bool load_recorded(const Recorded& recorded, const Recorded* next, const Loading& loading, Sum* out) const;
    void load_nearer(const Recorded& recorded, const Recorded* next, Loading& loading, std::span<Sum> out) const;
    void blend(const Across& across, const Recorded* next, float part, Loading& loading, std::span<Sum> out) const;
    void load_row(size_t row, Loading& loading) const;
};

}  // namespace ols
