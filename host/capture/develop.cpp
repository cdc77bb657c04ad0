// SPDX-License-Identifier: MIT
// Developing in bands of rows, so that the calibrated samples of all slots fit in a few tens of megabytes.
#include "capture/develop.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "capture/align.hpp"
#include "reflectance/demultiplex.hpp"

namespace ols {

namespace {

constexpr size_t band_samples = 1 << 16;  // of one plane; 159 rows of these are 42 MB

// One colour plane of a band of rows, for every row of the basis.
struct Band {
    size_t first_row, rows, samples;
    int channel;
};

class CycleDeveloper {
  public:
    CycleDeveloper(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                   const NoiseModel& noise)
        : sequence_(sequence), basis_(sequence.basis), calibration_(calibration), noise_(noise) {
        row_frames_.resize(size_t(basis_.rows));
        for (size_t s = 0; s < frames.slots.size(); ++s)
            if (sequence.slots[s].kind == SlotKind::basis) row_frames_[size_t(sequence.slots[s].row)] = frames.slots[s];
        for (const auto& frame : row_frames_)
            if (frame) any_ = frame.get();
        assert(any_);
        weight_sums_.resize(size_t(basis_.images()));
        for (int row = 0; row < basis_.rows; ++row)
            for (int image = 0; image < basis_.images(); ++image)
                weight_sums_[size_t(image)] += basis_.inverse(row, image);
    }

    Target develop() {
        target_.width = int(any_->width);
        target_.height = int(any_->height);
        target_.cfa = any_->cfa;
        const size_t pixels = size_t(any_->width) * any_->height;
        target_.lamps.assign(size_t(basis_.images() * target_.planes()), std::vector<float>(pixels));
        target_.mask.assign(pixels, 0);
        if (any_->format == PixelFormat::u16) target_.variance.assign(pixels, 0);
        for (int row = 0; row < basis_.rows; ++row)
            if (!row_frames_[size_t(row)]) target_.missing_lamps.push_back(row);
        // The mask is one for all lamps of a pixel; which lamp is missing stands in the header.
        if (!target_.missing_lamps.empty()) std::fill(target_.mask.begin(), target_.mask.end(), mask_missing);
        const size_t band_rows = std::max<size_t>(1, band_samples / any_->width);
        for (size_t y = 0; y < any_->height; y += band_rows) {
            const size_t rows = std::min(band_rows, any_->height - y);
            for (int channel = 0; channel < target_.planes(); ++channel)
                develop_band({y, rows, rows * any_->width, channel});
        }
        return std::move(target_);
    }

  private:
    void develop_band(const Band& band) {
        prepare_gain(band);
        if (any_->format == PixelFormat::u16) {
            const auto rows = load_band<int32_t, uint16_t>(band);
            invert<int32_t>(band, rows);
            std::vector<float> variance(band.samples);
            const auto pointers = pointers_to(rows);
            estimate_variance(basis_, pointers, band.samples, noise_, gain_, variance.data());
            // Of the colours of a pixel, their mean.
            float* out = &target_.variance[band.first_row * any_->width];
            for (size_t p = 0; p < band.samples; ++p) out[p] += variance[p] / float(target_.planes());
        } else {
            invert<float>(band, load_band<float, float>(band));
        }
    }

    // gain = 1 / (F t), black_whole and black_rest for each sample of the band.
    void prepare_gain(const Band& band) {
        const double exposure_us = double(any_->exposure_ticks) / double(ticks_per_us);
        const size_t channels = size_t(target_.planes());
        gain_.resize(band.samples);
        black_whole_.resize(band.samples);
        black_rest_.resize(band.samples);
        has_rest_ = false;
        for (size_t p = 0; p < band.samples; ++p) {
            const size_t at = (band.first_row * any_->width + p) * channels + size_t(band.channel);
            const float black = calibration_.black.data[at];
            gain_[p] = float(1 / (double(calibration_.flat.data[at]) * exposure_us));
            black_whole_[p] = any_->format == PixelFormat::u16 ? std::round(black) : black;
            black_rest_[p] = black - black_whole_[p];
            has_rest_ = has_rest_ || black_rest_[p] != 0;
        }
    }

    template <typename Sum>
    static std::vector<const Sum*> pointers_to(const std::vector<std::vector<Sum>>& rows) {
        std::vector<const Sum*> pointers;
        for (const auto& row : rows) pointers.push_back(row.data());
        return pointers;
    }

    // Calibrates and aligns the band of every row's frame; a missing one is zero.
    template <typename Sum, typename Sample>
    std::vector<std::vector<Sum>> load_band(const Band& band) {
        std::vector<std::vector<Sum>> rows(size_t(basis_.rows), std::vector<Sum>(band.samples, 0));
        std::vector<float> above_black(band.samples);
        for (size_t row = 0; row < rows.size(); ++row) {
            if (!row_frames_[row]) continue;
            subtract_black<Sample>(*row_frames_[row], band, above_black);
            if constexpr (std::is_same_v<Sum, int32_t>)
                align_samples(above_black, rows[row]);
            else
                rows[row] = above_black;  // nothing moves, and floats need no rounding
        }
        return rows;
    }

    template <typename Sample>
    void subtract_black(const Frame& frame, const Band& band, std::vector<float>& out) {
        const size_t channels = size_t(target_.planes()), width = frame.width;
        for (size_t y = 0; y < band.rows; ++y) {
            const std::byte* row = frame.samples.data() + (band.first_row + y) * frame.pitch_bytes;
            const auto* samples = reinterpret_cast<const Sample*>(row) + band.channel;
            uint32_t* mask = &target_.mask[(band.first_row + y) * width];
            for (size_t x = 0; x < width; ++x) {
                const float counts = float(samples[x * channels]);
                if (counts >= frame.white) mask[x] |= mask_saturated;
                out[y * width + x] = counts - black_whole_[y * width + x];
            }
        }
    }

    template <typename Sum>
    void invert(const Band& band, const std::vector<std::vector<Sum>>& rows) {
        std::vector<float*> lamps;
        for (int lamp = 0; lamp < basis_.images(); ++lamp)
            lamps.push_back(
                &target_.lamps[size_t(lamp * target_.planes() + band.channel)][band.first_row * any_->width]);
        const auto pointers = pointers_to(rows);
        demultiplex(basis_, std::span<const Sum* const>(pointers), band.samples, lamps, {.gain = gain_});
        for (int lamp = 0; has_rest_ && lamp < basis_.images(); ++lamp) {
            const double sum = weight_sums_[size_t(lamp)];
            float* out = lamps[size_t(lamp)];
            for (size_t p = 0; p < band.samples; ++p) out[p] -= float(sum * black_rest_[p] * gain_[p]);
        }
        for (const int lamp : target_.missing_lamps) std::fill_n(lamps[size_t(lamp)], band.samples, 0.0f);
    }

    const Sequence& sequence_;
    const Basis& basis_;
    const CameraCalibration& calibration_;
    const NoiseModel& noise_;
    std::vector<std::shared_ptr<const Frame>> row_frames_;
    const Frame* any_ = nullptr;
    std::vector<double> weight_sums_;  // of each image over all rows: what a constant in all rows becomes
    Target target_;
    std::vector<float> gain_, black_whole_, black_rest_;
    bool has_rest_ = false;
};

// Whether each image rests on its own row alone, so that a missing slot takes one image with it.
bool is_one_image_a_row(const Basis& basis) {
    for (int row = 0; row < basis.rows; ++row)
        for (int image = 0; image < basis.images(); ++image)
            if ((basis.inverse(row, image) != 0) != (row == image)) return false;
    return true;
}

}  // namespace

std::vector<int> missing_basis_slots(const CycleFrames& frames, const Sequence& sequence) {
    std::vector<int> missing;
    for (size_t s = 0; s < frames.slots.size(); ++s)
        if (sequence.slots[s].kind == SlotKind::basis && !frames.slots[s]) missing.push_back(int(s));
    return missing;
}

Result<Target> develop_cycle(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                             const NoiseModel& noise) {
    const auto missing = missing_basis_slots(frames, sequence);
    if (int(missing.size()) == sequence.basis.rows) return fail("every basis slot of the cycle is missing");
    if (!missing.empty() && !is_one_image_a_row(sequence.basis))
        return fail(fmt::format("every lamp of basis {} rests on all rows, and these slots are missing: {}",
                                sequence.basis.name, fmt::join(missing, ", ")));
    return CycleDeveloper(frames, sequence, calibration, noise).develop();
}

}  // namespace ols
