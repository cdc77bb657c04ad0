// SPDX-License-Identifier: MIT
// Figures by the noise model at the counts that each row has.
#include "stage/basis_figures.hpp"

#include <algorithm>
#include <cmath>

#include "stage/basis_noise.hpp"
#include "stage/exposure.hpp"

namespace ols {

namespace {

using Counts = std::vector<double>;

Counts expected_images(const Basis& basis, const Counts& lamp_counts) {
    Counts images(size_t(basis.images()), 0.0);
    for (int row = 0; row < basis.rows; ++row) {
        double mu = 0;
        for (int lamp = 0; lamp < basis.lamps; ++lamp) mu += basis.light(row, lamp) * lamp_counts[size_t(lamp)];
        for (int image = 0; image < basis.images(); ++image) images[size_t(image)] += basis.inverse(row, image) * mu;
    }
    return images;
}

double mean_over(const std::vector<int>& lamps, const Counts& lamp_counts) {
    double sum = 0;
    for (const int lamp : lamps) sum += lamp_counts[size_t(lamp)];
    return sum / double(lamps.size());
}

void predict_snr(const Basis& basis, const Counts& lamp_counts, const NoiseModel& noise, double shadow,
                 BasisFigures& figures) {
    const Counts variances = image_variances(basis, lamp_counts, noise);
    const Counts expected = expected_images(basis, lamp_counts);
    double error2 = 0, truth2 = 0;
    for (size_t image = 0; image < variances.size(); ++image) {
        const double truth = mean_over(basis.image_lamps[image], lamp_counts);
        figures.chart_counts.push_back(truth);
        figures.chart_snr.push_back(truth / std::sqrt(variances[image]));
        error2 += std::pow(expected[image] - truth, 2);
        truth2 += truth * truth;
        Counts shaded = lamp_counts;
        for (const int lamp : basis.image_lamps[image]) shaded[size_t(lamp)] *= shadow;
        figures.shadow_snr.push_back(shadow * truth / std::sqrt(image_variances(basis, shaded, noise)[image]));
    }
    figures.bias = std::sqrt(error2 / truth2);
}

void measure_light(const Sequence& sequence, const Counts& cosines, const GreyChart& chart, BasisFigures& figures) {
    double lux_ticks = 0;
    for (const Slot& slot : sequence.slots) {
        double lamps = 0, facing = 0;
        for (size_t lamp = 0; lamp < cosines.size(); ++lamp) {
            const double share = slot.light_ticks(lamp) / slot.exposure_ticks;
            lamps += share;
            facing += share * cosines[lamp];
        }
        lux_ticks += chart.lamp_lux * facing * slot.exposure_ticks;
        if (slot.kind != SlotKind::basis) continue;
        figures.lamps_lit_mean += lamps / sequence.basis.rows;
        figures.lamps_lit_max = std::max(figures.lamps_lit_max, lamps);
        figures.lux_peak = std::max(figures.lux_peak, chart.lamp_lux * facing);
    }
    figures.lux_mean = lux_ticks / double(sequence.cycle_ticks());
}

}  // namespace

double BasisFigures::mean_snr(const std::vector<double>& snr) const {
    double sum = 0;
    int lit = 0;
    // A lamp in the chart's plane lights it by a rounding error.
    const double least = 1e-9 * chart_counts[size_t(facing_image())];
    for (size_t image = 0; image < snr.size(); ++image)
        if (chart_counts[image] > least) {
            sum += snr[image];
            ++lit;
        }
    return lit ? sum / lit : 0;
}

int BasisFigures::facing_image() const {
    return int(std::max_element(chart_counts.begin(), chart_counts.end()) - chart_counts.begin());
}

BasisFigures measure_basis(const Sequence& sequence, const StageConfig& stage, const CameraConfig& camera,
                           const GreyChart& chart) {
    const Basis& basis = sequence.basis;
    BasisFigures figures;
    figures.matrix = matrix_figures(basis);
    for (int image = 0; image < basis.images(); ++image) figures.noise_gain.push_back(noise_variance(basis, image));

    Counts cosines = white_card_counts_per_us(stage.lamps, camera), white = cosines;
    for (double& cosine : cosines) cosine /= camera.counts_per_us;
    for (double& counts : white) counts *= sequence.config.basis_exposure_us;
    figures.white_share = brightest_row_counts(basis, white) / (camera.white - camera.black);
    Counts grey = white;
    for (double& counts : grey) counts *= chart.reflectance;
    predict_snr(basis, grey, camera.noise, chart.shadow, figures);
    measure_light(sequence, cosines, chart, figures);
    return figures;
}

}  // namespace ols
