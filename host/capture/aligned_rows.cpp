// SPDX-License-Identifier: MIT
// Warping a band of pixel rows at a time, every colour plane by itself, straight into the rows that are inverted.
#include "capture/aligned_rows.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
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
        planes.push_back({place, i, {until(band.first_row), until(band.first_row + band.rows) - until(band.first_row)}});
    }
    return planes;
}

void warp(const ColorPlanes<int16_t>::Plane& plane, const GroupMotion& motion, float fraction, const RowRange& rows,
          int16_t* out) {
    const auto size = size_t(plane.width);
    warp_counts({plane.samples.data(), plane.width, plane.height, size, 16383}, motion, fraction, rows, out, size);
}
void warp(const ColorPlanes<float>::Plane& plane, const GroupMotion& motion, float fraction, const RowRange& rows,
          float* out) {
    const auto size = size_t(plane.width);
    warp_samples({plane.samples.data(), plane.width, plane.height, size}, motion, fraction, rows, out, size);
}

template <typename Sum, typename Sample>
Sum rounded(Sample sample) {
    if constexpr (std::is_same_v<Sum, Sample>) return sample;
    return is_masked(sample) ? masked_sample<Sum> : Sum(sample + std::copysign(Sample(0.5), sample));
}

// One source's samples of the band.
template <typename Sum, typename Sample>
void warp_band(const typename AlignedRows<Sample, Sum>::Source& source, const Alignment& alignment, const Band& band,
               const std::vector<PlaneBand>& planes, Sum* out) {
    if constexpr (std::is_same_v<Sum, Sample>)
        if (planes.size() == 1)
            return warp(source.planes->planes[planes[0].plane], alignment.motion(source.place.interval, planes[0].plane),
                        source.place.fraction, planes[0].rows, out);
    std::vector<Sample> warped;
    for (const PlaneBand& part : planes) {
        const auto& plane = source.planes->planes[part.plane];
        const auto width = size_t(plane.width), step = size_t(part.place.step);
        warped.resize(width * size_t(part.rows.count));
        warp(plane, alignment.motion(source.place.interval, part.plane), source.place.fraction, part.rows,
             warped.data());
        for (int y = 0; y < part.rows.count; ++y) {
            const size_t row = size_t(part.rows.first + y) * step + size_t(part.place.first_y) - band.first_row;
            Sum* to = out + row * band.width + part.place.first_x;
            const Sample* from = warped.data() + size_t(y) * width;
            for (size_t x = 0; x < width; ++x) to[x * step] = rounded<Sum>(from[x]);
        }
    }
}

// The mean of what several sources show, of the samples that are there.
template <typename Sum, typename Sample>
void warp_mean(const std::vector<typename AlignedRows<Sample, Sum>::Source>& sources, const Alignment& alignment,
               const Band& band, const std::vector<PlaneBand>& planes, Sum* out) {
    std::vector<float> sums(band.samples()), counts(band.samples());
    for (const auto& source : sources) {
        warp_band<Sum, Sample>(source, alignment, band, planes, out);
        for (size_t p = 0; p < band.samples(); ++p)
            if (!is_masked(out[p])) sums[p] += float(out[p]), ++counts[p];
    }
    for (size_t p = 0; p < band.samples(); ++p)
        out[p] = counts[p] > 0 ? rounded<Sum>(sums[p] / counts[p]) : masked_sample<Sum>;
}

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

template <typename Sum>
void mark_masked(std::span<const Sum> row, uint8_t reason, std::span<uint8_t> marks) {
    for (size_t p = 0; p < row.size(); ++p) marks[p] |= is_masked(row[p]) ? reason : uint8_t(0);
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

// Marks and masks what a row does not show. A frame that saturates nowhere can lack a sample only where motion led outside.
template <typename Sample, typename Sum>
void AlignedRows<Sample, Sum>::mark(size_t row, const Band& band, bool clipped_stay, RowBand<Sum>& loaded,
                                    std::span<uint8_t> marks) const {
    std::vector<Sum>& samples = loaded.rows[row];
    bool saturates = false;
    for (const Source& source : rows[row]) saturates = saturates || source.planes->any_masked;
    mark_masked<Sum>(samples, saturates ? mask_saturated : mask_missing, marks);
    if (rows[row].empty()) return;
    if (clipped_stay)
        for (size_t p = 0; p < samples.size(); ++p)
            if (is_masked(samples[p])) samples[p] = saturates ? Sum(loaded.white[p]) : Sum(0);
    if (!masks_untrusted) return;
    for (const Source& source : rows[row]) {
        const float* trust = alignment->confidence(source.place.interval).data() + band.first_pixel();
        for (size_t p = 0; p < samples.size(); ++p)
            if (trust[p] < trusted_confidence) samples[p] = masked_sample<Sum>;
    }
}

template <typename Sample, typename Sum>
RowBand<Sum> AlignedRows<Sample, Sum>::load(const Band& band, const Frame& like, const Image& black,
                                            bool clipped_stay) const {
    RowBand<Sum> loaded;
    loaded.rows.resize(rows.size());
    loaded.masked.assign(band.samples(), 0);
    set_black(loaded, band, like, black);
    const auto planes = planes_of(band, like.cfa);
    std::vector<std::vector<uint8_t>> marks(rows.size());
    for_each_index(threads, rows.size(), [&](size_t row) {
        auto& out = loaded.rows[row];
        out.assign(band.samples(), masked_sample<Sum>);
        if (rows[row].size() == 1) warp_band<Sum, Sample>(rows[row][0], *alignment, band, planes, out.data());
        if (rows[row].size() > 1) warp_mean<Sum, Sample>(rows[row], *alignment, band, planes, out.data());
        marks[row].assign(band.samples(), 0);
        mark(row, band, clipped_stay, loaded, marks[row]);
    });
    for (const auto& some : marks)
        for (size_t p = 0; p < some.size(); ++p) loaded.masked[p] |= some[p];
    return loaded;
}

template struct AlignedRows<int16_t, int16_t>;
template struct AlignedRows<float, int32_t>;
template struct AlignedRows<float, float>;

}  // namespace ols
