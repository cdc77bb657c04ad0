// SPDX-License-Identifier: MIT
// Warping a band of pixel rows at a time, straight into the rows that are inverted.
#include "develop/aligned_rows.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <type_traits>

#include "demultiplex/masked_sample.hpp"
#include "develop/warp.hpp"

namespace ols {

namespace {

RowRange range_of(const Band& band) {
    return {int(band.first_row), int(band.rows)};
}

using CountChannels = SignalPlanes<int16_t>::Channels;
using SampleChannels = SignalPlanes<float>::Channels;

// False where it is known that no sample is masked.
bool warp(const CountChannels& channels, int largest, const GroupMotion& motion, float fraction, const Band& band,
          int16_t* out, const CountChannels* next) {
    const auto& plane = channels[size_t(band.channel)];
    const int16_t* const next_counts = next ? (*next)[size_t(band.channel)].row(0) : nullptr;
    return warp_counts({plane.row(0), plane.grid(), plane.pitch(), largest, true, plane.margin, next_counts}, motion,
                       fraction, range_of(band), out, band.width);
}
bool warp(const SampleChannels& channels, int, const GroupMotion& motion, float fraction, const Band& band, float* out,
          const SampleChannels*) {
    const auto& plane = channels[size_t(band.channel)];
    warp_samples({plane.row(0), plane.grid(), plane.pitch(), true}, motion, fraction, range_of(band), out, band.width);
    return true;
}

template <typename Sum, typename Sample>
Sum rounded(Sample sample) {
    if constexpr (std::is_same_v<Sum, Sample>) return sample;
    return is_masked(sample) ? masked_sample<Sum> : Sum(sample + std::copysign(Sample(0.5), sample));
}

bool warp(const SampleChannels& channels, int largest, const GroupMotion& motion, float fraction, const Band& band,
          int32_t* out, const SampleChannels* next) {
    std::vector<float, PlaneAllocator<float>> warped(band.samples());
    warp(channels, largest, motion, fraction, band, warped.data(), next);
    std::ranges::transform(warped, out, rounded<int32_t, float>);
    return true;
}

template <typename Sum>
void set_black(RowBand<Sum>& loaded, const Band& band, const Frame& like, const Image& black) {
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
        for (const Source& source : sources) is_used[source.nearer.place.interval] = true;
    std::vector<float> least(alignment->confidence(0).size(), 1.0f);
    for (size_t i = 0; i < is_used.size(); ++i)
        if (is_used[i])
            std::ranges::transform(least, alignment->confidence(i), least.begin(),
                                   [](float a, float b) { return std::min(a, b); });
    return least;
}

template <typename Sample, typename Sum>
size_t AlignedRows<Sample, Sum>::blended_sources() const {
    size_t count = 0;
    for (const auto& sources : rows)
        count += size_t(std::ranges::count_if(sources, [](const Source& source) { return source.across.has_value(); }));
    return count;
}

// False where it is known that no sample is masked.
template <typename Sample, typename Sum>
bool AlignedRows<Sample, Sum>::load_recorded(const Recorded& recorded, const Recorded* next, const Loading& loading,
                                             Sum* out) const {
    const auto& [planes, place] = recorded;
    const bool may_lack = warp(planes->channels, planes->largest, alignment->motion(place.interval), place.fraction,
                               loading.band, out, next ? &next->planes->channels : nullptr);
    if (loading.brightness) loading.brightness->apply(place.tick, out);
    return planes->any_masked && may_lack;
}

template <typename Sample, typename Sum>
void AlignedRows<Sample, Sum>::load_nearer(const Recorded& recorded, const Recorded* next, Loading& loading,
                                           std::span<Sum> out) const {
    if (!load_recorded(recorded, next, loading, out.data())) return;
    std::vector<uint8_t>& masked = loading.loaded.masked;
    for (size_t p = 0; p < out.size(); ++p) masked[p] |= uint8_t(is_masked(out[p]) ? int(mask_saturated) : 0);
    if (!loading.clipped_stay) return;
    const auto& [planes, place] = recorded;
    warp(planes->clipped, planes->largest, alignment->motion(place.interval), place.fraction, loading.band,
         loading.beside.data(), nullptr);
    for (size_t p = 0; p < out.size(); ++p)
        if (is_masked(out[p])) out[p] = loading.beside[p];
}

// `part`: of the row that the source is.
template <typename Sample, typename Sum>
void AlignedRows<Sample, Sum>::blend(const Across& across, const Recorded* next, float part, Loading& loading,
                                     std::span<Sum> out) const {
    const float* const trust = across.trust->data() + loading.band.first_pixel();
    if (std::all_of(trust, trust + out.size(), [](float value) { return value == 0; })) return;
    load_recorded(across.recorded, next, loading, loading.beside.data());
    blend_across<Sum>({out, loading.beside.data(), trust, across.share, loading.loaded.noise.data(), part});
}

template <typename Sample, typename Sum>
auto AlignedRows<Sample, Sum>::loaded_after(size_t row, size_t source) const -> const Recorded* {
    if (source + 1 < rows[row].size()) return &rows[row][source + 1].nearer;
    return row + 1 < rows.size() && !rows[row + 1].empty() ? &rows[row + 1].front().nearer : nullptr;
}

template <typename Sample, typename Sum>
void AlignedRows<Sample, Sum>::load_row(size_t row, Loading& loading) const {
    const std::span<Sum> out(loading.loaded.row(row), loading.band.samples());
    std::vector<uint8_t>& masked = loading.loaded.masked;
    const std::vector<Source>& sources = rows[row];
    std::vector<float> sums(sources.size() > 1 ? out.size() : 0), counts(sums.size());
    if (sources.empty()) {
        std::ranges::fill(out, masked_sample<Sum>);
        for (uint8_t& mark : masked) mark |= mask_missing;
    }
    for (size_t s = 0; s < sources.size(); ++s) {
        const Source& source = sources[s];
        const Recorded* const next = loaded_after(row, s);
        load_nearer(source.nearer, source.across ? &source.across->recorded : next, loading, out);
        if (masks_untrusted) {
            const float* trust =
                alignment->confidence(source.nearer.place.interval).data() + loading.band.first_pixel();
            for (size_t p = 0; p < out.size(); ++p)
                if (trust[p] < trusted_confidence) out[p] = masked_sample<Sum>, masked[p] |= mask_misaligned;
        }
        if (source.across) blend(*source.across, next, 1 / float(sources.size()), loading, out);
        for (size_t p = 0; p < sums.size(); ++p)
            if (!is_masked(out[p])) sums[p] += float(out[p]), ++counts[p];
    }
    for (size_t p = 0; p < sums.size(); ++p)
        out[p] = counts[p] > 0 ? rounded<Sum>(sums[p] / counts[p]) : masked_sample<Sum>;
}

template <typename Sample, typename Sum>
RowBand<Sum> AlignedRows<Sample, Sum>::load(const Band& band, const Frame& like, const Image& black,
                                            bool clipped_stay) const {
    RowBand<Sum> loaded(rows.size(), band.samples());
    set_black(loaded, band, like, black);
    std::optional<FollowedBrightness<Sum>> brightness;
    if (tracking)
        brightness.emplace(tracking->load(band, like, black, false), knots, noise,
                           std::span(alignment->moves()).subspan(band.first_pixel(), band.samples()));
    constexpr size_t lanes = 16;
    const size_t padded = (band.samples() + lanes - 1) / lanes * lanes;
    if (blended_sources() > 0) loaded.noise.assign(padded, 0.0f);
    Loading loading{band, clipped_stay, brightness ? &*brightness : nullptr, loaded, {}};
    loading.beside.resize(padded);
    for (size_t row = 0; row < rows.size(); ++row) load_row(row, loading);
    return loaded;
}

template struct AlignedRows<int16_t, int16_t>;
template struct AlignedRows<float, int32_t>;
template struct AlignedRows<float, float>;

}  // namespace ols
