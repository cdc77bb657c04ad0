// SPDX-License-Identifier: MIT
// Inverting in bands of pixel rows, so that the calibrated samples of all slots fit in a few tens of megabytes.
#include "capture/target_inversion.hpp"

#include <algorithm>
#include <cmath>

#include "reflectance/demultiplex.hpp"
#include "reflectance/estimate_bound.hpp"
#include "reflectance/variance.hpp"
#include "stage/playback.hpp"

namespace ols {

namespace {

// Of one plane: 159 rows of these are 5 MB in integers of 32 bits. Whole pixel rows, two at least so that a mosaic's colours are all
// there; short enough that memory is used again and again, and what was loaded is near when it is inverted.
constexpr size_t band_samples = 1 << 13;

const char* prior_name(Estimate estimate) {
    return estimate == Estimate::smooth ? "smooth" : "nonnegative";
}

// What a target says of its masked samples.
struct MaskTally {
    size_t filled = 0, unsolved = 0, clipped = 0;
    double worst_gain = 1;
    EstimateFigures estimates;

    nlohmann::json to_json(Estimate estimate) const {
        nlohmann::json json = {{"filled", filled}, {"unsolved", unsolved}, {"worst_noise_gain", worst_gain}};
        if (estimates.samples > 0)
            json["estimated"] = {{"samples", estimates.samples},
                                 {"prior", prior_name(estimate)},
                                 {"length_rad", SmoothPrior{}.length_rad},
                                 {"single_share", SmoothPrior{}.single_share},
                                 {"norm_limit", norm_limit},
                                 {"worst_bias", estimates.worst_bias},
                                 {"mean_bias", estimates.mean_bias()}};
        if (clipped > 0) json["estimated"] = {{"samples", clipped}, {"prior", "clipped"}};
        return json;
    }
};

// Filled samples may need more than 16 bits.
RowBand<int32_t> widened(const RowBand<int16_t>& band) {
    RowBand<int32_t> wide;
    for (const auto& row : band.rows) {
        auto& to = wide.rows.emplace_back(row.size());
        std::ranges::transform(row, to.begin(),
                               [](int16_t v) { return is_masked(v) ? masked_sample<int32_t> : int32_t(v); });
    }
    wide.masked = band.masked, wide.black_rest = band.black_rest, wide.white = band.white;
    return wide;
}

// Makes one target.
template <typename Rows>
class TargetInversion {
  public:
    TargetInversion(const Rows& rows, const Frame& like, const InversionJob& job)
        : rows_(rows),
          like_(like),
          basis_(job.basis),
          calibration_(job.calibration),
          noise_(job.noise),
          fills_(job.fills),
          estimate_(job.estimate),
          threads_(job.threads),
          variance_(job.basis, job.noise) {
        weight_sums_.resize(size_t(basis_.images()));
        for (int row = 0; row < basis_.rows; ++row)
            for (int image = 0; image < basis_.images(); ++image)
                weight_sums_[size_t(image)] += basis_.inverse(row, image);
    }

    Target invert() {
        target_.width = int(like_.width);
        target_.height = int(like_.height);
        target_.cfa = like_.cfa;
        const size_t pixels = size_t(like_.width) * like_.height;
        target_.lamps.resize(size_t(basis_.images() * target_.planes()));
        for (Plane& lamp : target_.lamps) lamp = Plane(pixels);
        target_.mask.assign(pixels, 0);
        if (like_.format == PixelFormat::u16) target_.variance.assign(pixels, 0);
        if (!fills_) target_.missing_lamps = empty_rows(rows_.rows);
        const size_t band_rows = std::max<size_t>(2, band_samples / like_.width / 2 * 2);
        for (size_t y = 0; y < like_.height; y += band_rows)
            for (int channel = 0; channel < target_.planes(); ++channel) {
                const Band band{y, std::min(band_rows, like_.height - y), like_.width, channel, target_.planes()};
                load_and_invert(band);
            }
        if (tally_.filled + tally_.unsolved > 0) target_.provenance["masked"] = tally_.to_json(estimate_);
        return std::move(target_);
    }

  private:
    using Sum = typename Rows::Sum;

    void load_and_invert(const Band& band) {
        RowBand<Sum> loaded = rows_.load(band, like_, calibration_.black, !fills_);
        if constexpr (std::is_same_v<Sum, int16_t>)
            if (needs_filling(loaded)) return invert_band(band, widened(loaded));
        invert_band(band, std::move(loaded));
    }

    template <typename Count>
    void invert_band(const Band& band, RowBand<Count> loaded) {
        const auto rows = loaded.pointers();
        const std::vector<const Count*> inputs(rows.begin(), rows.end());
        prepare_gain(band);
        fill(band, loaded, rows);
        std::vector<float*> lamps;
        for (int lamp = 0; lamp < basis_.images(); ++lamp)
            lamps.push_back(&target_.lamps[size_t(lamp * target_.planes() + band.channel)][band.first_pixel()]);
        demultiplex(basis_, std::span<const Count* const>(inputs), band.samples(), lamps,
                    {.gain = gain_, .threads = threads_});
        subtract_black_rest(loaded.black_rest, lamps);
        std::vector<float> variance;
        if constexpr (!std::is_same_v<Count, float>) {
            variance.resize(band.samples());
            variance_.estimate(inputs, band.samples(), gain_, variance.data());
        }
        if (!sample_fills_.empty()) note_fills(band, lamps, variance);
        for (size_t p = 0; p < band.samples(); ++p) target_.mask[band.first_pixel() + p] |= loaded.masked[p];
        // Of the colours of a pixel, their mean.
        for (size_t p = 0; p < variance.size(); ++p)
            target_.variance[band.first_pixel() + p] += variance[p] / float(target_.planes());
    }

    template <typename Count>
    bool needs_filling(const RowBand<Count>& loaded) const {
        return fills_ && std::ranges::any_of(loaded.masked, [](uint8_t mark) { return mark != 0; });
    }

    // gain = 1 / (F t) for each sample of the band.
    void prepare_gain(const Band& band) {
        const double exposure_us = double(like_.exposure_ticks) / double(ticks_per_us);
        gain_.resize(band.samples());
        for (size_t p = 0; p < band.samples(); ++p) {
            const size_t at = (band.first_pixel() + p) * size_t(band.channels) + size_t(band.channel);
            gain_[p] = float(1 / (double(calibration_.flat.data[at]) * exposure_us));
        }
    }

    template <typename Count>
    void fill(const Band& band, const RowBand<Count>& loaded, const std::vector<Count*>& rows) {
        sample_fills_.clear();
        for (const int row : target_.missing_lamps) std::fill_n(rows[size_t(row)], loaded.masked.size(), Count(0));
        if (!needs_filling(loaded)) return;
        sample_fills_.resize(loaded.masked.size());
        lost_.assign(rows.size(), 0);
        for (const int row : empty_rows(rows_.rows)) lost_[size_t(row)] = 1;
        const RowFiller filler(fills_(), {loaded.black_rest, loaded.white, lost_, noise_}, sample_fills_);
        if constexpr (!std::is_same_v<Count, int16_t>) {
            fill_rows(filler, rows, loaded.masked);  // load_and_invert() widened
            if (estimate_ == Estimate::clipped) count_clipped(band, loaded, rows);
        }
    }

    // Pixels that were not solved are filled again, with what their saturated samples read: then lost rows alone are masked.
    template <typename Count>
    void count_clipped(const Band& band, const RowBand<Count>& loaded, const std::vector<Count*>& rows) {
        std::vector<uint8_t> unsolved(sample_fills_.size());
        std::ranges::transform(sample_fills_, unsolved.begin(),
                               [](const SampleFill& done) { return done.kind == FillKind::unsolved; });
        if (std::ranges::find(unsolved, 1) == unsolved.end()) return;
        const RowBand<Sum> clipped = rows_.load(band, like_, calibration_.black, true);
        for (size_t row = 0; row < rows.size(); ++row)
            for (size_t p = 0; p < unsolved.size(); ++p)
                if (unsolved[p]) {
                    const Sum count = clipped.rows[row][p];
                    rows[row][p] = is_masked(count) ? masked_sample<Count> : Count(count);
                }
        std::vector<SampleFill> again(unsolved.size());
        fill_rows(RowFiller(fills_(), {loaded.black_rest, loaded.white, lost_, noise_}, again), rows, unsolved);
        for (size_t p = 0; p < unsolved.size(); ++p) {
            if (!unsolved[p]) continue;
            sample_fills_[p] = again[p];
            if (again[p].kind != FillKind::unsolved) sample_fills_[p].kind = FillKind::clipped;
        }
    }

    void subtract_black_rest(const std::vector<float>& rest, const std::vector<float*>& lamps) {
        if (std::ranges::all_of(rest, [](float counts) { return counts == 0; })) return;
        for (size_t lamp = 0; lamp < lamps.size(); ++lamp)
            for (size_t p = 0; p < rest.size(); ++p) lamps[lamp][p] -= float(weight_sums_[lamp] * rest[p] * gain_[p]);
        for (const int lamp : target_.missing_lamps) std::fill_n(lamps[size_t(lamp)], rest.size(), 0.0f);
    }

    // Masks, noise gain and variance of what was filled; pixels that were not solved become 0.
    void note_fills(const Band& band, const std::vector<float*>& lamps, std::vector<float>& variance) {
        if (target_.noise_gain.empty()) target_.noise_gain.assign(target_.mask.size(), 1);
        const std::vector<const float*> images(lamps.begin(), lamps.end());
        for (size_t p = 0; p < sample_fills_.size(); ++p) {
            const SampleFill& done = sample_fills_[p];
            if (done.kind == FillKind::none) continue;
            const size_t pixel = band.first_pixel() + p;
            float& gain = target_.noise_gain[pixel];
            if (!variance.empty()) variance[p] *= done.noise_gain;
            if (done.kind == FillKind::unsolved) {
                target_.mask[pixel] |= mask_unsolved;
                gain = 0;
                for (float* lamp : lamps) lamp[p] = 0;
                ++tally_.unsolved;
                continue;
            }
            if (done.kind != FillKind::solved) target_.mask[pixel] |= mask_estimated;
            if (done.kind == FillKind::clipped) ++tally_.clipped;
            if (gain > 0) gain = std::max(gain, done.noise_gain);  // of the colours of a pixel, the worst
            tally_.worst_gain = std::max(tally_.worst_gain, double(done.worst_noise_gain));
            ++tally_.filled;
        }
        if (has_prior(estimate_))
            judge_estimates(fills_().model(), estimate_, sample_fills_, images, variance, tally_.estimates);
    }

    const Rows& rows_;
    const Frame& like_;
    const Basis& basis_;
    const CameraCalibration& calibration_;
    const NoiseModel& noise_;
    const std::function<FillCache&()> fills_;
    const Estimate estimate_;
    const int threads_;
    const VarianceEstimate variance_;
    std::vector<double> weight_sums_;  // of each image over all rows: what a constant in all rows becomes
    Target target_;
    MaskTally tally_;
    std::vector<float> gain_;
    std::vector<uint8_t> lost_;
    std::vector<SampleFill> sample_fills_;  // of the band; empty where none of its samples is masked
};

}  // namespace

template <typename Rows>
Target invert_rows(const Rows& rows, const Frame& like, const InversionJob& job) {
    return TargetInversion<Rows>(rows, like, job).invert();
}

template Target invert_rows(const RecordedRows<int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const RecordedRows<float>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<int16_t, int16_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, float>&, const Frame&, const InversionJob&);

}  // namespace ols
