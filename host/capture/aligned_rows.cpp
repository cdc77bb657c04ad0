// SPDX-License-Identifier: MIT
// Warping a band of pixel rows at a time, every colour plane by itself, straight into the rows that are inverted.
#include "capture/aligned_rows.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <type_traits>

#include "parallel.hpp"
#include "reflectance/masked_sample.hpp"

namespace ols {

namespace {

// A band of pixel rows in one colour plane.
struct PlaneBand {
    ColorPlace place;
    size_t plane;
    RowRange rows;  // of the plane
};

// The planes that a channel of the band consists of: all four of a mosaic.
std::vector<PlaneBand> planes_of(const Band& band, Cfa cfa) {
    std::vector<PlaneBand> planes;
    const auto places = color_places(cfa);
    for (size_t i = 0; i < places.size(); ++i) {
        const ColorPlace& place = places[i];
        if (band.channels == 3 && place.channel != band.channel) continue;
        const auto until = [&](size_t row) { return place.height(int(row)); };  // rows of the plane above a frame's row
        planes.push_back(
            {place, i, {until(band.first_row), until(band.first_row + band.rows) - until(band.first_row)}});
    }
    return planes;
}

void warp(const ColorPlanes<int16_t>::Plane& plane, int largest, const GroupMotion& motion, float fraction,
          const RowRange& rows, int16_t* out) {
    const auto pitch = size_t(plane.width);
    warp_counts({plane.samples.data(), plane.width, plane.height, pitch, largest, true}, motion, fraction, rows, out,
                pitch);
}
void warp(const ColorPlanes<float>::Plane& plane, int, const GroupMotion& motion, float fraction, const RowRange& rows,
          float* out) {
    const auto pitch = size_t(plane.width);
    warp_samples({plane.samples.data(), plane.width, plane.height, pitch, true}, motion, fraction, rows, out, pitch);
}

template <typename Sum, typename Sample>
Sum rounded(Sample sample) {
    if constexpr (std::is_same_v<Sum, Sample>) return sample;
    return is_masked(sample) ? masked_sample<Sum> : Sum(sample + std::copysign(Sample(0.5), sample));
}

// Interleaves the rows of two colour planes, as they lie in a mosaic's row.
template <typename Sum, typename Sample>
void interleave(const Sample* even, const Sample* odd, size_t width, Sum* out) {
    for (size_t x = 0; x < width / 2; ++x) {
        out[2 * x] = rounded<Sum>(even[x]);
        out[2 * x + 1] = rounded<Sum>(odd[x]);
    }
    if (width % 2) out[width - 1] = rounded<Sum>(even[width / 2]);
}

// Warps a band of one source after the other.
template <typename Sample, typename Sum>
class BandWarp {
  public:
    using Rows = AlignedRows<Sample, Sum>;
    using Source = typename Rows::Source;

    BandWarp(const Rows& rows, const Band& band, Cfa cfa) : rows_(rows), band_(band), parts_(planes_of(band, cfa)) {}

    // `planes` are the source's, or its clipped ones.
    void warp(const Source& source, const std::vector<typename ColorPlanes<Sample>::Plane>& planes, Sum* out) {
        if constexpr (std::is_same_v<Sum, Sample>)
            if (parts_.size() == 1) return warp_part(source, planes, parts_[0], out);
        warped_.resize(parts_.size());
        for (size_t i = 0; i < parts_.size(); ++i) {
            warped_[i].resize(size_t(planes[parts_[i].plane].width) * size_t(parts_[i].rows.count));
            warp_part(source, planes, parts_[i], warped_[i].data());
        }
        if (parts_.size() == 1)
            std::ranges::transform(warped_[0], out, rounded<Sum, Sample>);
        else
            interleave_mosaic(out);
    }

  private:
    void warp_part(const Source& source, const std::vector<typename ColorPlanes<Sample>::Plane>& planes,
                   const PlaneBand& part, Sample* out) const {
        ols::warp(planes[part.plane], source.planes->largest,
                  rows_.alignment->motion(source.place.interval, part.plane), source.place.fraction, part.rows, out);
    }

    void interleave_mosaic(Sum* out) const {
        const size_t even_width = (band_.width + 1) / 2, odd_width = band_.width / 2;
        for (size_t parity = 0; parity < 2; ++parity) {  // parts 0 and 1 make the even rows, 2 and 3 the odd ones
            const PlaneBand& part = parts_[2 * parity];
            for (size_t y = 0; y < size_t(part.rows.count); ++y) {
                const size_t row = 2 * (size_t(part.rows.first) + y) + parity - band_.first_row;
                interleave(&warped_[2 * parity][y * even_width], &warped_[2 * parity + 1][y * odd_width], band_.width,
                           out + row * band_.width);
            }
        }
    }

    const Rows& rows_;
    const Band& band_;
    const std::vector<PlaneBand> parts_;
    std::vector<std::vector<Sample, PlaneAllocator<Sample>>> warped_;
};

template <typename Sum>
void set_black(RowBand<Sum>& loaded, const Band& band, const Frame& like, const Image& black) {
    loaded.black_rest.resize(band.samples());
    loaded.white.resize(band.samples());
    for (size_t p = 0; p < band.samples(); ++p) {
        const float counts = black.data[(band.first_pixel() + p) * size_t(band.channels) + size_t(band.channel)];
        const float taken = like.format == PixelFormat::u16 ? std::round(counts) : counts;
        loaded.black_rest[p] = counts - taken;
        loaded.white[p] = like.white - taken;
    }
}

}  // namespace

template <typename Sample, typename Sum>
std::vector<float> AlignedRows<Sample, Sum>::confidence() const {
    std::vector<bool> is_used(alignment->intervals());
    for (const auto& sources : rows)
        for (const Source& source : sources) is_used[source.place.interval] = true;
    std::vector<float> least(alignment->confidence(0).size(), 1.0f);
    for (size_t i = 0; i < is_used.size(); ++i)
        if (is_used[i])
            std::ranges::transform(least, alignment->confidence(i), least.begin(),
                                   [](float a, float b) { return std::min(a, b); });
    return least;
}

// A frame that saturates nowhere lacks no sample: what motion leads to outside it takes its edge.
template <typename Sample, typename Sum>
void AlignedRows<Sample, Sum>::load_row(size_t row, const Band& band, Cfa cfa, bool clipped_stay,
                                        const FollowedBrightness* brightness, std::span<Sum> out,
                                        std::vector<uint8_t>& marks) const {
    const std::vector<Source>& sources = rows[row];
    std::vector<float> sums(sources.size() > 1 ? out.size() : 0), counts(sums.size());
    BandWarp<Sample, Sum> warp(*this, band, cfa);
    if (sources.empty()) std::ranges::fill(out, masked_sample<Sum>), marks.assign(out.size(), mask_missing);
    for (const Source& source : sources) {
        warp.warp(source, source.planes->planes, out.data());
        if (source.planes->any_masked) {
            marks.resize(out.size());
            for (size_t p = 0; p < out.size(); ++p) marks[p] |= uint8_t(is_masked(out[p]) ? int(mask_saturated) : 0);
            if (clipped_stay) warp.warp(source, source.planes->clipped, out.data());
        }
        if (brightness) brightness->apply(source.place, out);
        if (masks_untrusted) {
            const float* trust = alignment->confidence(source.place.interval).data() + band.first_pixel();
            marks.resize(out.size());
            for (size_t p = 0; p < out.size(); ++p)
                if (trust[p] < trusted_confidence) out[p] = masked_sample<Sum>, marks[p] |= mask_misaligned;
        }
        for (size_t p = 0; p < sums.size(); ++p)
            if (!is_masked(out[p])) sums[p] += float(out[p]), ++counts[p];
    }
    for (size_t p = 0; p < sums.size(); ++p)
        out[p] = counts[p] > 0 ? rounded<Sum>(sums[p] / counts[p]) : masked_sample<Sum>;
}

template <typename Sample, typename Sum>
RowBand<Sum> AlignedRows<Sample, Sum>::load(const Band& band, const Frame& like, const Image& black,
                                            bool clipped_stay) const {
    RowBand<Sum> loaded;
    loaded.rows.resize(rows.size());
    loaded.masked.assign(band.samples(), 0);
    set_black(loaded, band, like, black);
    std::optional<FollowedBrightness> brightness;
    if (tracking) brightness.emplace(tracking->load(band, like, black, false).rows, instant, noise);
    std::vector<std::vector<uint8_t>> marks(rows.size());
    for_each_index(threads, rows.size(), [&](size_t row) {
        loaded.rows[row].resize(band.samples());
        load_row(row, band, like.cfa, clipped_stay, brightness ? &*brightness : nullptr, loaded.rows[row], marks[row]);
    });
    for (const auto& some : marks)
        for (size_t p = 0; p < some.size(); ++p) loaded.masked[p] |= some[p];
    return loaded;
}

template struct AlignedRows<int16_t, int16_t>;
template struct AlignedRows<float, int32_t>;
template struct AlignedRows<float, float>;

}  // namespace ols
