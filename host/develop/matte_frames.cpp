// SPDX-License-Identifier: MIT
// Matte frames pass through the warp as the rows of a basis do, and are averaged instead of inverted.
#include "develop/matte_frames.hpp"

#include <algorithm>
#include <cmath>

#include "demultiplex/masked_sample.hpp"
#include "develop/aligned_rows.hpp"
#include "develop/lazy_basis.hpp"
#include "parallel.hpp"

namespace ols {

namespace {

// In slots, at an even pace.
uint64_t distance(uint64_t number, uint64_t target) {
    return number < target ? target - number : number - target;
}

// Samples that are averaged at a time: all that is kept of them stays near.
constexpr size_t band_samples = 1 << 13;

// Weighted means in the making, of a band's pixels.
struct Means {
    explicit Means(size_t pixels) : weights(pixels), squares(pixels), counts(pixels) {}

    std::vector<float> weights, squares, counts;  // sums of w, w^2 and w * count
};

// Adds what is there and, if asked for, trusted. Written for the compiler to vectorise.
template <bool trusted, typename Sum>
void add(const Sum* row, const float* confidence, float weight, Means& means) {
    const size_t pixels = means.counts.size();
    float *weights = means.weights.data(), *squares = means.squares.data(), *counts = means.counts.data();
    for (size_t p = 0; p < pixels; ++p) {
        const bool is_there = !is_masked(row[p]) && (!trusted || confidence[p] >= trusted_confidence);
        const float w = is_there ? weight : 0.0f, count = is_there ? float(row[p]) : 0.0f;
        weights[p] += w;
        squares[p] += w * w;
        counts[p] += w * count;
    }
}

bool lacks_any(const Means& means) {
    return std::ranges::find(means.weights, 0.0f) != means.weights.end();
}

// Takes those of `other` where there are none.
void complete(Means& means, const Means& other) {
    for (size_t p = 0; p < means.counts.size(); ++p) {
        if (means.weights[p] > 0) continue;
        means.weights[p] = other.weights[p], means.squares[p] = other.squares[p], means.counts[p] = other.counts[p];
    }
}

template <typename Sample, typename Sum>
class MatteMean {
  public:
    explicit MatteMean(const MatteJob& job) : job_(job), like_(*job.frames.front().frame) {
        const auto black = black_planes<Sample>(job.calibration.black, like_.cfa, like_.format);
        rows_.rows.resize(job.frames.size());
        rows_.alignment = job.alignment;
        for_each_index(job.threads, job.frames.size(), [&](size_t i) {
            const Frame& frame = *job.frames[i].frame;
            rows_.rows[i].push_back(
                {.nearer = {std::make_shared<SignalPlanes<Sample>>(signal_planes(frame, black, true)),
                            job.alignment->place_of(middle_tick(frame))}});
        });
    }

    TargetMatte make() {
        TargetMatte matte;
        matte.frames = int(job_.frames.size());
        const size_t pixels = size_t(like_.width) * like_.height;
        matte.planes.assign(like_.cfa == Cfa::rgb ? 3 : 1, std::vector<float>(pixels));
        if (like_.format == PixelFormat::u16) matte.variance.assign(pixels, 0);
        const size_t band_rows = std::max<size_t>(1, band_samples / like_.width);
        for_each_index(job_.threads, (like_.height + band_rows - 1) / band_rows, [&](size_t b) {
            const size_t y = b * band_rows;
            for (int channel = 0; channel < int(matte.planes.size()); ++channel)
                average({y, std::min(band_rows, like_.height - y), like_.width, channel, int(matte.planes.size())},
                        matte);
        });
        return matte;
    }

  private:
    void average(const Band& band, TargetMatte& matte) const {
        const RowBand<Sum> seen = rows_.load(band, like_, job_.calibration.black, false);
        Means means = means_of(seen, band);
        if (lacks_any(means)) complete(means, means_of(rows_.load(band, like_, job_.calibration.black, true), band));
        const double exposure_us = double(like_.exposure_ticks) / double(ticks_per_us);
        for (size_t p = 0; p < band.samples(); ++p) {
            if (means.weights[p] == 0) continue;
            const size_t pixel = band.first_pixel() + p;
            const float flat = job_.calibration.flat.data[pixel * size_t(band.channels) + size_t(band.channel)];
            const float count = means.counts[p] / means.weights[p] - seen.black_rest[p],
                        gain = float(1 / (double(flat) * exposure_us));
            matte.planes[size_t(band.channel)][pixel] = gain * count;
            if (matte.variance.empty()) continue;
            const float sigma =
                            float(job_.noise.read_counts) + float(job_.noise.shot) * std::sqrt(std::max(count, 0.0f)),
                        share = means.squares[p] / (means.weights[p] * means.weights[p]);
            matte.variance[pixel] += gain * gain * share * sigma * sigma / float(matte.planes.size());
        }
    }

    // Of the samples that are there and trusted, or where none is, of those that are there.
    Means means_of(const RowBand<Sum>& band, const Band& place) const {
        Means trusted(place.samples());
        add_rows<true>(band, place, trusted);
        if (lacks_any(trusted)) {
            Means all(place.samples());
            add_rows<false>(band, place, all);
            complete(trusted, all);
        }
        return trusted;
    }

    template <bool trusted>
    void add_rows(const RowBand<Sum>& band, const Band& place, Means& means) const {
        for (size_t i = 0; i < band.rows(); ++i) {
            const auto& confidence = job_.alignment->confidence(rows_.rows[i][0].nearer.place.interval);
            add<trusted>(band.row(i), confidence.data() + place.first_pixel(), float(job_.weights[i]), means);
        }
    }

    const MatteJob& job_;
    const Frame& like_;
    AlignedRows<Sample, Sum> rows_;  // a row a frame
};

}  // namespace

std::vector<uint64_t> nearest_matte_frames(const Sequence& sequence, uint64_t target,
                                           const std::function<bool(uint64_t)>& is_recorded) {
    const FrameRange range = frames_around(sequence, target);
    std::vector<uint64_t> numbers;
    for (uint64_t number = range.first; number <= range.last; ++number)
        if (sequence.slots[number % sequence.slots.size()].kind == SlotKind::matte && is_recorded(number))
            numbers.push_back(number);
    std::ranges::stable_sort(numbers, {}, [target](uint64_t number) { return distance(number, target); });
    numbers.resize(std::min(numbers.size(), matte_frames_a_target));
    std::ranges::sort(numbers);
    return numbers;
}

std::vector<double> matte_weights(std::span<const MatteFrame> frames, uint64_t target, const Sequence& sequence) {
    const auto is_matte = [](const Slot& slot) { return slot.kind == SlotKind::matte; };
    const double spacing = double(sequence.slots.size()) / double(std::ranges::count_if(sequence.slots, is_matte));
    double farthest = 0;
    for (const MatteFrame& one : frames) farthest = std::max(farthest, double(distance(one.number, target)));
    std::vector<double> weights;
    for (const MatteFrame& one : frames)
        weights.push_back(1 - double(distance(one.number, target)) / (farthest + spacing));
    return weights;
}

TargetMatte mean_matte(const MatteJob& job) {
    const Frame& like = *job.frames.front().frame;
    if (fits_shorts(like.format, like.white, job.calibration.black)) return MatteMean<int16_t, int16_t>(job).make();
    if (like.format == PixelFormat::u16) return MatteMean<float, int32_t>(job).make();
    return MatteMean<float, float>(job).make();
}

}  // namespace ols
