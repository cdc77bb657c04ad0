// SPDX-License-Identifier: MIT
// Inverting in bands of pixel rows, each from frames to lamps on one thread, so that what is loaded is near when it is inverted.
#include "develop/target_inversion.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "demultiplex/demultiplex.hpp"
#include "demultiplex/estimate_bound.hpp"
#include "demultiplex/masked_sample.hpp"
#include "demultiplex/variance.hpp"
#include "parallel.hpp"
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
template <typename Count>
using Filled = std::conditional_t<std::is_same_v<Count, int16_t>, int32_t, Count>;

std::vector<uint32_t> masked_samples(const std::vector<uint8_t>& marks) {
    std::vector<uint32_t> found;
    for (size_t p = 0; p < marks.size(); ++p)
        if (marks[p]) found.push_back(uint32_t(p));
    return found;
}

// These samples of a band, as a band of their own. What they leave behind counts 0 and is not masked, in any row.
template <typename Count>
RowBand<Filled<Count>> taken_out(RowBand<Count>& band, const std::vector<uint32_t>& samples) {
    RowBand<Filled<Count>> taken(band.rows(), samples.size());
    for (size_t row = 0; row < band.rows(); ++row) {
        Count* const from = band.row(row);
        for (size_t k = 0; k < samples.size(); ++k) {
            const Count count = std::exchange(from[samples[k]], Count(0));
            taken.row(row)[k] = is_masked(count) ? masked_sample<Filled<Count>> : Filled<Count>(count);
        }
    }
    for (size_t k = 0; k < samples.size(); ++k) {
        const uint32_t p = samples[k];
        taken.masked[k] = std::exchange(band.masked[p], uint8_t(0));
        taken.black_rest[k] = band.black_rest[p], taken.white[k] = band.white[p];
    }
    return taken;
}

// What all bands of a target share.
struct TargetJob {
    const Frame& like;
    const InversionJob& job;
    std::vector<int> lost_rows;
    std::vector<uint8_t> is_lost;  // of each row
    Demultiplexer demultiplexer;
    VarianceEstimate variance;
    // What a constant in all rows becomes: the sums of an image's weights, of which images share some.
    std::vector<double> weight_sums;
    std::vector<size_t> weight_sum_of;  // of each image

    TargetJob(const Frame& like_frame, const InversionJob& inversion, std::vector<int> lost)
        : like(like_frame),
          job(inversion),
          lost_rows(std::move(lost)),
          is_lost(size_t(inversion.basis.rows)),
          demultiplexer(inversion.basis),
          variance(inversion.basis, inversion.noise) {
        for (const int row : lost_rows) is_lost[size_t(row)] = 1;
        for (int image = 0; image < job.basis.images(); ++image) {
            const double sum = weight_sum(image);
            const auto known = std::ranges::find(weight_sums, sum);
            weight_sum_of.push_back(size_t(known - weight_sums.begin()));
            if (known == weight_sums.end()) weight_sums.push_back(sum);
        }
    }

  private:
    double weight_sum(int image) const {
        const Basis& basis = job.basis;
        double sum = 0;  // exact where weights are integers
        for (int row = 0; row < basis.rows; ++row)
            sum += basis.has_integers() ? basis.weight(row, image) : basis.inverse(row, image);
        return basis.has_integers() ? basis.scale * sum : sum;
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
        if (job_.parity) job_.parity->gather(loaded, band_, job_.noise, shared_.lost_rows);
        for (size_t p = 0; p < band_.samples(); ++p) target_.mask[band_.first_pixel() + p] |= loaded.masked[p];
        for (const int row : target_.missing_lamps) std::fill_n(loaded.row(size_t(row)), band_.samples(), Sum(0));
        prepare_gain();
        const std::vector<uint32_t> masked = job_.fills ? masked_samples(loaded.masked) : std::vector<uint32_t>();
        std::vector<float> variance = masked.empty() ? solve(loaded, gain_, lamps_) : solve_with_masked(loaded, masked);
        // The rows taken as equal in weight.
        for (size_t p = 0; p < variance.size() && !loaded.noise.empty(); ++p)
            variance[p] *= 1 + loaded.noise[p] / float(loaded.rows());
        if (!sample_fills_.empty()) note_fills(variance);
        // Of the colours of a pixel, their mean.
        for (size_t p = 0; p < variance.size(); ++p)
            target_.variance[band_.first_pixel() + p] += variance[p] / float(target_.planes());
    }

  private:
    using Sum = typename Rows::Sum;
    using FilledBand = RowBand<Filled<Sum>>;

    RowBand<Sum> load(bool clipped_stay) const {
        return recorded_.load(band_, shared_.like, job_.calibration.black, clipped_stay);
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

    // From counts, of which none is masked, to lamps. Their variance, of a camera that counts.
    template <typename Count>
    std::vector<float> solve(const RowBand<Count>& counts, std::span<const float> gain,
                             const std::vector<float*>& lamps) const {
        std::vector<const Count*> rows;
        for (size_t row = 0; row < counts.rows(); ++row) rows.push_back(counts.row(row));
        const auto rests = black_rests(counts.black_rest, gain);
        std::vector<const float*> rest_of;
        for (size_t lamp = 0; lamp < lamps.size() && !rests.empty(); ++lamp)
            rest_of.push_back(rests[shared_.weight_sum_of[lamp]].data());
        shared_.demultiplexer.invert(std::span<const Count* const>(rows), gain.size(), lamps,
                                     {.gain = gain, .threads = 1, .offsets = rest_of});
        for (const int lamp : target_.missing_lamps) std::fill_n(lamps[size_t(lamp)], gain.size(), 0.0f);
        std::vector<float> variance;
        if constexpr (!std::is_same_v<Count, float>) {
            variance.resize(gain.size());
            shared_.variance.estimate(rows, gain.size(), gain, variance.data());
        }
        return variance;
    }

    // No sample depends on another: the few that are masked, mostly, are filled and solved by themselves.
    std::vector<float> solve_with_masked(RowBand<Sum>& loaded, const std::vector<uint32_t>& masked) {
        FilledBand apart = taken_out(loaded, masked);
        const std::vector<SampleFill> fills = fill(apart, masked);
        sample_fills_.resize(band_.samples());
        std::vector<float> gain;
        for (size_t k = 0; k < masked.size(); ++k) {
            sample_fills_[masked[k]] = fills[k];
            gain.push_back(gain_[masked[k]]);
        }
        if (masked.size() == band_.samples()) return solve(apart, gain, lamps_);

        std::vector<float> variance = solve(loaded, gain_, lamps_);
        std::vector<float> images(lamps_.size() * masked.size());
        std::vector<float*> lamps;
        for (size_t lamp = 0; lamp < lamps_.size(); ++lamp) lamps.push_back(&images[lamp * masked.size()]);
        const std::vector<float> variance_apart = solve(apart, gain, lamps);
        for (size_t lamp = 0; lamp < lamps_.size(); ++lamp)
            for (size_t k = 0; k < masked.size(); ++k) lamps_[lamp][masked[k]] = lamps[lamp][k];
        for (size_t k = 0; k < variance_apart.size(); ++k) variance[masked[k]] = variance_apart[k];
        return variance;
    }

    // `samples`: where in the band they lie.
    std::vector<SampleFill> fill(FilledBand& apart, const std::vector<uint32_t>& samples) {
        std::vector<SampleFill> fills(samples.size());
        fill_rows(filler(apart, fills), rows_of(apart), apart.masked);
        if (job_.estimate == Estimate::clipped) count_clipped(apart, samples, fills);
        return fills;
    }

    static std::vector<Filled<Sum>*> rows_of(FilledBand& apart) {
        std::vector<Filled<Sum>*> rows;
        for (size_t row = 0; row < apart.rows(); ++row) rows.push_back(apart.row(row));
        return rows;
    }

    RowFiller filler(const FilledBand& apart, std::span<SampleFill> fills) const {
        return {job_.fills(), {apart.black_rest, apart.white, shared_.is_lost, job_.noise}, fills};
    }

    // Samples that were not solved are filled again, with what those that are saturated read: then lost rows alone are masked.
    void count_clipped(FilledBand& apart, const std::vector<uint32_t>& samples, std::vector<SampleFill>& fills) {
        std::vector<uint8_t> unsolved(fills.size());
        std::ranges::transform(fills, unsolved.begin(),
                               [](const SampleFill& done) { return done.kind == FillKind::unsolved; });
        if (std::ranges::find(unsolved, 1) == unsolved.end()) return;
        const RowBand<Sum> clipped = load(true);
        for (size_t row = 0; row < apart.rows(); ++row)
            for (size_t k = 0; k < unsolved.size(); ++k)
                if (unsolved[k]) {
                    const Sum count = clipped.row(row)[samples[k]];
                    apart.row(row)[k] = is_masked(count) ? masked_sample<Filled<Sum>> : Filled<Sum>(count);
                }
        std::vector<SampleFill> again(unsolved.size());
        fill_rows(filler(apart, again), rows_of(apart), unsolved);
        for (size_t k = 0; k < unsolved.size(); ++k) {
            if (!unsolved[k]) continue;
            fills[k] = again[k];
            if (again[k].kind != FillKind::unsolved) fills[k].kind = FillKind::clipped;
        }
    }

    // Of each weight sum, what the rest of the black level becomes in a lamp; empty where the level is whole.
    std::vector<std::vector<float>> black_rests(const std::vector<float>& rest, std::span<const float> gain) const {
        if (std::ranges::all_of(rest, [](float counts) { return counts == 0; })) return {};
        std::vector<std::vector<float>> out;
        for (const double sum : shared_.weight_sums) {
            std::vector<float>& lamp = out.emplace_back(rest.size());
            for (size_t p = 0; p < rest.size(); ++p) lamp[p] = float(sum * rest[p] * gain[p]);
        }
        return out;
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

template Target invert_rows(const RecordedRows<int16_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const RecordedRows<int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const RecordedRows<float>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<int16_t, int16_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, int32_t>&, const Frame&, const InversionJob&);
template Target invert_rows(const AlignedRows<float, float>&, const Frame&, const InversionJob&);

}  // namespace ols
