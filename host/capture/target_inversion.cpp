// SPDX-License-Identifier: MIT
// Inverting in bands of pixel rows, each from frames to lamps on one thread, so that what is loaded is near when it is inverted.
#include "capture/target_inversion.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "parallel.hpp"
#include "reflectance/demultiplex.hpp"
#include "reflectance/estimate_bound.hpp"
#include "reflectance/variance.hpp"
#include "stage/playback.hpp"

namespace ols {

namespace {

// Of one plane: 159 rows of these are 0.8 MB in integers of 16 bits, which second-level caches hold. A pixel row at least.
constexpr size_t band_samples = 2560;

// Whole pixel rows, so many that bands of lamps begin on cache lines.
size_t rows_of_band(size_t width) {
    constexpr size_t line = 64 / sizeof(float);
    const size_t unit = line / std::gcd(line, width);
    return std::max<size_t>(1, band_samples / width / unit) * unit;
}

// What a target says of its masked samples.
struct MaskTally {
    size_t filled = 0, unsolved = 0, clipped = 0;
    double worst_gain = 1;
    EstimateFigures estimates;

    void add(const MaskTally& other) {
        filled += other.filled, unsolved += other.unsolved, clipped += other.clipped;
        worst_gain = std::max(worst_gain, other.worst_gain);
        estimates.samples += other.estimates.samples;
        estimates.worst_bias = std::max(estimates.worst_bias, other.estimates.worst_bias);
        estimates.sum_of_biases += other.estimates.sum_of_biases;
    }

    nlohmann::json to_json(Estimate estimate) const {
        nlohmann::json json = {{"filled", filled}, {"unsolved", unsolved}, {"worst_noise_gain", worst_gain}};
        if (estimates.samples > 0)
            json["estimated"] = {{"samples", estimates.samples},
                                 {"prior", estimate_name(estimate)},
                                 {"length_rad", SmoothPrior{}.length_rad},
                                 {"single_share", SmoothPrior{}.single_share},
                                 {"norm_limit", norm_limit},
                                 {"worst_bias", estimates.worst_bias},
                                 {"mean_bias", estimates.mean_bias()}};
        if (clipped > 0) json["estimated"] = {{"samples", clipped}, {"prior", estimate_name(Estimate::clipped)}};
        return json;
    }
};

// Filled samples may need more than 16 bits.
RowBand<int32_t> widened(const RowBand<int16_t>& band) {
    const size_t samples = band.masked.size();
    RowBand<int32_t> wide(band.rows(), samples);
    for (size_t row = 0; row < band.rows(); ++row)
        std::transform(band.row(row), band.row(row) + samples, wide.row(row),
                       [](int16_t v) { return is_masked(v) ? masked_sample<int32_t> : int32_t(v); });
    wide.masked = band.masked, wide.black_rest = band.black_rest, wide.white = band.white;
    return wide;
}

// What all bands of a target share.
struct TargetJob {
    const Frame& like;
    const InversionJob& job;
    std::vector<int> lost_rows;
    std::vector<uint8_t> is_lost;  // of each row
    Demultiplexer demultiplexer;
    VarianceEstimate variance;
    std::vector<double> weight_sums;  // of each image over all rows: what a constant in all rows becomes

    TargetJob(const Frame& like_frame, const InversionJob& inversion, std::vector<int> lost)
        : like(like_frame),
          job(inversion),
          lost_rows(std::move(lost)),
          is_lost(size_t(inversion.basis.rows)),
          demultiplexer(inversion.basis),
          variance(inversion.basis, inversion.noise),
          weight_sums(size_t(inversion.basis.images())) {
        for (const int row : lost_rows) is_lost[size_t(row)] = 1;
        for (int row = 0; row < job.basis.rows; ++row)
            for (int image = 0; image < job.basis.images(); ++image)
                weight_sums[size_t(image)] += job.basis.inverse(row, image);
    }
};

// One band of a target, in one colour.
template <typename Rows>
class BandInversion {
  public:
    // `noise_gain`: of the band's pixels; made when the first of them is filled.
    BandInversion(const Rows& recorded, const TargetJob& shared, const Band& band, Target& target, MaskTally& tally,
                  std::vector<float>& noise_gain)
        : recorded_(recorded),
          shared_(shared),
          job_(shared.job),
          band_(band),
          target_(target),
          tally_(tally),
          noise_gain_(noise_gain) {
        for (int lamp = 0; lamp < job_.basis.images(); ++lamp)
            lamps_.push_back(&target_.lamps[size_t(lamp * target_.planes() + band_.channel)][band_.first_pixel()]);
    }

    void invert() {
        RowBand<Sum> loaded = load(!job_.fills);
        if constexpr (std::is_same_v<Sum, int16_t>)
            if (needs_filling(loaded)) return invert(widened(loaded));
        invert(std::move(loaded));
    }

  private:
    using Sum = typename Rows::Sum;

    RowBand<Sum> load(bool clipped_stay) const {
        return recorded_.load(band_, shared_.like, job_.calibration.black, clipped_stay);
    }

    template <typename Count>
    void invert(RowBand<Count> loaded) {
        std::vector<Count*> rows;
        for (size_t row = 0; row < loaded.rows(); ++row) rows.push_back(loaded.row(row));
        const std::vector<const Count*> inputs(rows.begin(), rows.end());
        prepare_gain();
        fill(loaded, rows);
        shared_.demultiplexer.invert(std::span<const Count* const>(inputs), band_.samples(), lamps_,
                                     {.gain = gain_, .threads = 1});
        subtract_black_rest(loaded.black_rest);
        std::vector<float> variance;
        if constexpr (!std::is_same_v<Count, float>) {
            variance.resize(band_.samples());
            shared_.variance.estimate(inputs, band_.samples(), gain_, variance.data());
        }
        if (!sample_fills_.empty()) note_fills(variance);
        for (size_t p = 0; p < band_.samples(); ++p) target_.mask[band_.first_pixel() + p] |= loaded.masked[p];
        // Of the colours of a pixel, their mean.
        for (size_t p = 0; p < variance.size(); ++p)
            target_.variance[band_.first_pixel() + p] += variance[p] / float(target_.planes());
    }

    template <typename Count>
    bool needs_filling(const RowBand<Count>& loaded) const {
        return job_.fills && std::ranges::any_of(loaded.masked, [](uint8_t mark) { return mark != 0; });
    }

    // gain = 1 / (F t) for each sample of the band.
    void prepare_gain() {
        const double exposure_us = double(shared_.like.exposure_ticks) / double(ticks_per_us);
        gain_.resize(band_.samples());
        for (size_t p = 0; p < band_.samples(); ++p) {
            const size_t at = (band_.first_pixel() + p) * size_t(band_.channels) + size_t(band_.channel);
            gain_[p] = float(1 / (double(job_.calibration.flat.data[at]) * exposure_us));
        }
    }

    template <typename Count>
    void fill(const RowBand<Count>& loaded, const std::vector<Count*>& rows) {
        for (const int row : target_.missing_lamps) std::fill_n(rows[size_t(row)], loaded.masked.size(), Count(0));
        if (!needs_filling(loaded)) return;
        sample_fills_.resize(loaded.masked.size());
        if constexpr (!std::is_same_v<Count, int16_t>) {  // invert() widened
            fill_rows(filler(loaded, sample_fills_), rows, loaded.masked);
            if (job_.estimate == Estimate::clipped) count_clipped(loaded, rows);
        }
    }

    template <typename Count>
    RowFiller filler(const RowBand<Count>& loaded, std::span<SampleFill> fills) const {
        return {job_.fills(), {loaded.black_rest, loaded.white, shared_.is_lost, job_.noise}, fills};
    }

    // Pixels that were not solved are filled again, with what their saturated samples read: then lost rows alone are masked.
    template <typename Count>
    void count_clipped(const RowBand<Count>& loaded, const std::vector<Count*>& rows) {
        std::vector<uint8_t> unsolved(sample_fills_.size());
        std::ranges::transform(sample_fills_, unsolved.begin(),
                               [](const SampleFill& done) { return done.kind == FillKind::unsolved; });
        if (std::ranges::find(unsolved, 1) == unsolved.end()) return;
        const RowBand<Sum> clipped = load(true);
        for (size_t row = 0; row < rows.size(); ++row)
            for (size_t p = 0; p < unsolved.size(); ++p)
                if (unsolved[p]) {
                    const Sum count = clipped.row(row)[p];
                    rows[row][p] = is_masked(count) ? masked_sample<Count> : Count(count);
                }
        std::vector<SampleFill> again(unsolved.size());
        fill_rows(filler(loaded, again), rows, unsolved);
        for (size_t p = 0; p < unsolved.size(); ++p) {
            if (!unsolved[p]) continue;
            sample_fills_[p] = again[p];
            if (again[p].kind != FillKind::unsolved) sample_fills_[p].kind = FillKind::clipped;
        }
    }

    void subtract_black_rest(const std::vector<float>& rest) {
        if (std::ranges::all_of(rest, [](float counts) { return counts == 0; })) return;
        for (size_t lamp = 0; lamp < lamps_.size(); ++lamp)
            for (size_t p = 0; p < rest.size(); ++p)
                lamps_[lamp][p] -= float(shared_.weight_sums[lamp] * rest[p] * gain_[p]);
        for (const int lamp : target_.missing_lamps) std::fill_n(lamps_[size_t(lamp)], rest.size(), 0.0f);
    }

    // Masks, noise gain and variance of what was filled; pixels that were not solved become 0.
    void note_fills(std::vector<float>& variance) {
        noise_gain_.resize(band_.samples(), 1);
        const std::vector<const float*> images(lamps_.begin(), lamps_.end());
        for (size_t p = 0; p < sample_fills_.size(); ++p) {
            const SampleFill& done = sample_fills_[p];
            if (done.kind == FillKind::none) continue;
            uint32_t& mask = target_.mask[band_.first_pixel() + p];
            float& gain = noise_gain_[p];
            if (!variance.empty()) variance[p] *= done.noise_gain;
            if (done.kind == FillKind::unsolved) {
                mask |= mask_unsolved;
                gain = 0;
                for (float* lamp : lamps_) lamp[p] = 0;
                ++tally_.unsolved;
                continue;
            }
            if (done.kind != FillKind::solved) mask |= mask_estimated;
            if (done.kind == FillKind::clipped) ++tally_.clipped;
            if (gain > 0) gain = std::max(gain, done.noise_gain);  // of the colours of a pixel, the worst
            tally_.worst_gain = std::max(tally_.worst_gain, double(done.worst_noise_gain));
            ++tally_.filled;
        }
        if (has_prior(job_.estimate))
            judge_estimates(job_.fills().model(), job_.estimate, sample_fills_, images, variance, tally_.estimates);
    }

    const Rows& recorded_;
    const TargetJob& shared_;
    const InversionJob& job_;
    const Band& band_;
    Target& target_;
    MaskTally& tally_;
    std::vector<float>& noise_gain_;
    std::vector<float*> lamps_;
    std::vector<float> gain_;
    std::vector<SampleFill> sample_fills_;  // empty where none of the band's samples is masked
};

Target empty_target(const Frame& like, const InversionJob& job) {
    Target target;
    target.width = int(like.width);
    target.height = int(like.height);
    target.cfa = like.cfa;
    const size_t pixels = size_t(like.width) * like.height;
    target.lamps.resize(size_t(job.basis.images() * target.planes()));
    for (Plane& lamp : target.lamps) lamp = Plane(pixels);
    target.mask.assign(pixels, 0);
    if (like.format == PixelFormat::u16) target.variance.assign(pixels, 0);
    return target;
}

}  // namespace

template <typename Rows>
Target invert_rows(const Rows& rows, const Frame& like, const InversionJob& job) {
    const TargetJob shared(like, job, empty_rows(rows.rows));
    Target target = empty_target(like, job);
    if (!job.fills) target.missing_lamps = shared.lost_rows;
    struct Notes {
        MaskTally tally;
        std::vector<float> noise_gain;
    };
    const size_t band_rows = rows_of_band(like.width);
    std::vector<Notes> notes((like.height + band_rows - 1) / band_rows);
    for_each_index(job.threads, notes.size(), [&](size_t b) {
        const size_t y = b * band_rows;
        for (int channel = 0; channel < target.planes(); ++channel) {
            const Band band{y, std::min(band_rows, like.height - y), like.width, channel, target.planes()};
            BandInversion(rows, shared, band, target, notes[b].tally, notes[b].noise_gain).invert();
        }
    });
    MaskTally tally;
    for (size_t b = 0; b < notes.size(); ++b) {
        tally.add(notes[b].tally);
        if (notes[b].noise_gain.empty()) continue;
        if (target.noise_gain.empty()) target.noise_gain.assign(target.mask.size(), 1);
        std::ranges::copy(notes[b].noise_gain, target.noise_gain.begin() + std::ptrdiff_t(b * band_rows * like.width));
    }
    if (tally.filled + tally.unsolved > 0) target.provenance["masked"] = tally.to_json(job.estimate);
    return target;
}

template Target invert_rows(const RecordedRows<int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const RecordedRows<float>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<int16_t, int16_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, float>&, const Frame&, const InversionJob&);

}  // namespace ols
