// SPDX-License-Identifier: MIT
// Developing in bands of rows, so that the calibrated samples of all slots fit in a few tens of megabytes.
#include "capture/develop.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "capture/row_band.hpp"
#include "reflectance/demultiplex.hpp"
#include "reflectance/estimate_bound.hpp"

namespace ols {

namespace {

constexpr size_t band_samples = 1 << 16;  // of one plane; 159 rows of these are 42 MB

const char* estimate_name(Estimate estimate) {
    return estimate == Estimate::smooth ? "smooth" : "nonnegative";
}

// The frames of each row: its own slots', or where there are none, those of the neighbouring cycles.
RowFrames row_frames(const CycleFrames& frames, const Sequence& sequence) {
    RowFrames own(size_t(sequence.basis.rows)), neighbours(size_t(sequence.basis.rows));
    for (size_t s = 0; s < frames.slots.size(); ++s) {
        if (sequence.slots[s].kind != SlotKind::basis) continue;
        const auto row = size_t(sequence.slots[s].row);
        if (frames.slots[s]) own[row].push_back(frames.slots[s]);
        if (!frames.neighbours.empty())
            neighbours[row].insert(neighbours[row].end(), frames.neighbours[s].begin(), frames.neighbours[s].end());
    }
    for (size_t row = 0; row < own.size(); ++row)
        if (own[row].empty()) own[row] = std::move(neighbours[row]);
    return own;
}

std::vector<int> empty_rows(const RowFrames& frames) {
    std::vector<int> empty;
    for (size_t row = 0; row < frames.size(); ++row)
        if (frames[row].empty()) empty.push_back(int(row));
    return empty;
}

// What a target says of its masked samples.
struct MaskTally {
    size_t filled = 0, unsolved = 0;
    double worst_gain = 1;
    EstimateFigures estimates;

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
        return json;
    }
};

// Makes one target.
class CycleInversion {
  public:
    // `fills` is null where masked samples are left as they are.
    CycleInversion(const RowFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                   const NoiseModel& noise, const std::function<FillCache&()>& fills, Estimate estimate)
        : frames_(frames),
          basis_(sequence.basis),
          calibration_(calibration),
          noise_(noise),
          fills_(fills),
          estimate_(estimate) {
        const auto shown = std::find_if(frames.begin(), frames.end(), [](const auto& row) { return !row.empty(); });
        assert(shown != frames.end());
        any_ = shown->front().get();
        weight_sums_.resize(size_t(basis_.images()));
        for (int row = 0; row < basis_.rows; ++row)
            for (int image = 0; image < basis_.images(); ++image)
                weight_sums_[size_t(image)] += basis_.inverse(row, image);
    }

    Target invert() {
        target_.width = int(any_->width);
        target_.height = int(any_->height);
        target_.cfa = any_->cfa;
        const size_t pixels = size_t(any_->width) * any_->height;
        target_.lamps.assign(size_t(basis_.images() * target_.planes()), std::vector<float>(pixels));
        target_.mask.assign(pixels, 0);
        if (any_->format == PixelFormat::u16) target_.variance.assign(pixels, 0);
        if (!fills_) target_.missing_lamps = empty_rows(frames_);
        const size_t band_rows = std::max<size_t>(1, band_samples / any_->width);
        for (size_t y = 0; y < any_->height; y += band_rows)
            for (int channel = 0; channel < target_.planes(); ++channel) {
                const Band band{y, std::min(band_rows, any_->height - y), any_->width, channel, target_.planes()};
                if (any_->format == PixelFormat::u16)
                    invert_band<int32_t>(band);
                else
                    invert_band<float>(band);
            }
        if (tally_.filled + tally_.unsolved > 0) target_.provenance["masked"] = tally_.to_json(estimate_);
        return std::move(target_);
    }

  private:
    template <typename Sum>
    void invert_band(const Band& band) {
        RowBand<Sum> loaded = load_row_band<Sum>(frames_, band, calibration_.black, !fills_);
        const auto rows = loaded.pointers();
        const std::vector<const Sum*> inputs(rows.begin(), rows.end());
        prepare_gain(band);
        fill(loaded, rows);
        std::vector<float*> lamps;
        for (int lamp = 0; lamp < basis_.images(); ++lamp)
            lamps.push_back(&target_.lamps[size_t(lamp * target_.planes() + band.channel)][band.first_pixel()]);
        demultiplex(basis_, std::span<const Sum* const>(inputs), band.samples(), lamps, {.gain = gain_});
        subtract_black_rest(loaded.black_rest, lamps);
        std::vector<float> variance;
        if constexpr (std::is_same_v<Sum, int32_t>) {
            variance.resize(band.samples());
            estimate_variance(basis_, inputs, band.samples(), noise_, gain_, variance.data());
        }
        if (!sample_fills_.empty()) note_fills(band, lamps, variance);
        for (size_t p = 0; p < band.samples(); ++p) target_.mask[band.first_pixel() + p] |= loaded.masked[p];
        // Of the colours of a pixel, their mean.
        for (size_t p = 0; p < variance.size(); ++p)
            target_.variance[band.first_pixel() + p] += variance[p] / float(target_.planes());
    }

    // gain = 1 / (F t) for each sample of the band.
    void prepare_gain(const Band& band) {
        const double exposure_us = double(any_->exposure_ticks) / double(ticks_per_us);
        gain_.resize(band.samples());
        for (size_t p = 0; p < band.samples(); ++p) {
            const size_t at = (band.first_pixel() + p) * size_t(band.channels) + size_t(band.channel);
            gain_[p] = float(1 / (double(calibration_.flat.data[at]) * exposure_us));
        }
    }

    template <typename Sum>
    void fill(const RowBand<Sum>& loaded, const std::vector<Sum*>& rows) {
        sample_fills_.clear();
        for (const int row : target_.missing_lamps) std::fill_n(rows[size_t(row)], loaded.masked.size(), Sum(0));
        if (!fills_ || std::ranges::all_of(loaded.masked, [](uint8_t mark) { return mark == 0; })) return;
        sample_fills_.resize(loaded.masked.size());
        lost_.assign(rows.size(), 0);
        for (const int row : empty_rows(frames_)) lost_[size_t(row)] = 1;
        const RowFiller filler(fills_(), {loaded.black_rest, loaded.white, lost_, noise_}, sample_fills_);
        fill_rows(filler, rows, loaded.masked);
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
            if (done.kind == FillKind::estimated) target_.mask[pixel] |= mask_estimated;
            if (gain > 0) gain = std::max(gain, done.noise_gain);  // of the colours of a pixel, the worst
            tally_.worst_gain = std::max(tally_.worst_gain, double(done.worst_noise_gain));
            ++tally_.filled;
        }
        judge_estimates(fills_().model(), estimate_, sample_fills_, images, variance, tally_.estimates);
    }

    const RowFrames& frames_;
    const Basis& basis_;
    const CameraCalibration& calibration_;
    const NoiseModel& noise_;
    const std::function<FillCache&()>& fills_;
    const Estimate estimate_;
    const Frame* any_ = nullptr;
    std::vector<double> weight_sums_;  // of each image over all rows: what a constant in all rows becomes
    Target target_;
    MaskTally tally_;
    std::vector<float> gain_;
    std::vector<uint8_t> lost_;
    std::vector<SampleFill> sample_fills_;  // of the band; empty where none of its samples is masked
};

}  // namespace

std::vector<int> missing_basis_slots(const CycleFrames& frames, const Sequence& sequence) {
    std::vector<int> missing;
    for (size_t s = 0; s < frames.slots.size(); ++s)
        if (sequence.slots[s].kind == SlotKind::basis && !frames.slots[s]) missing.push_back(int(s));
    return missing;
}

Developer::Developer(const Sequence& sequence, const CameraCalibration& calibration, const NoiseModel& noise,
                     DevelopOptions options)
    : sequence_(sequence), calibration_(calibration), noise_(noise), options_(std::move(options)) {
    assert(options_.estimate == Estimate::none || int(options_.lamps.size()) == sequence.basis.lamps);
}

Developer::~Developer() = default;

FillCache& Developer::fills() {
    if (!fills_) {
        model_ = fill_model(sequence_.basis);
        if (options_.estimate != Estimate::none)
            add_smooth_prior(model_, image_lights(sequence_.basis, options_.lamps));
        fills_ = std::make_unique<FillCache>(model_, options_.estimate);
    }
    return *fills_;
}

Result<Target> Developer::develop(const CycleFrames& frames) {
    const RowFrames rows = row_frames(frames, sequence_);
    const std::vector<int> lost = empty_rows(rows);
    const Basis& basis = sequence_.basis;
    if (int(lost.size()) == basis.rows) return fail("every basis slot of the cycle is missing");
    const bool stand_alone = options_.estimate == Estimate::none && is_one_image_a_row(basis);
    if (!lost.empty() && !stand_alone && fills().fill_for(lost)->kind == FillKind::unsolved)
        return fail(
            fmt::format("every lamp of basis {} rests on all rows, slots {} are missing, and the other rows do not "
                        "make up for them: "
                        "record again, or run with --fill neighbours (the subject holds still) or --estimate smooth",
                        basis.name, fmt::join(missing_basis_slots(frames, sequence_), ", ")));
    const std::function<FillCache&()> make_fills = [this]() -> FillCache& { return fills(); };
    const std::function<FillCache&()> leave_as_is;
    return CycleInversion(rows, sequence_, calibration_, noise_, stand_alone ? leave_as_is : make_fills,
                          options_.estimate)
        .invert();
}

Result<Target> develop_cycle(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                             const NoiseModel& noise) {
    return Developer(sequence, calibration, noise).develop(frames);
}

}  // namespace ols
