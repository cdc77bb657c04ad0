// SPDX-License-Identifier: MIT
// What a basis is worth on a stage: its noise in pictures, and its light on the subject.
#pragma once

#include <vector>

#include "stage/basis_inverse.hpp"
#include "stage/sequence.hpp"

namespace ols {

// The subject that noise is predicted for: a card at the centre that faces the camera, so that a lamp lights it by the
// cosine between them.
struct GreyChart {
    // Skin shows 4 to 8 % of saturation where a card of 98.5 % shows 25 % (Wenger 5.1): its mean.
    double reflectance = 0.24;
    double shadow = 0.01;   // what deep shadow leaves of the light of the lamps that an image shows
    double lamp_lux = 420;  // of one lamp at the centre (Wenger 3)
};

struct BasisFigures {
    MatrixFigures matrix;
    // For each image. Noise variance when every slot has the same noise, that of a single lamp's slot being 1.
    std::vector<double> noise_gain;
    std::vector<double> chart_counts;  // of the image, per exposure: the signal
    std::vector<double> chart_snr;
    // Where the image's own lamps are in shadow and the others light the chart as before: the case in which multiplexing
    // loses (Wenger 5.4).
    std::vector<double> shadow_snr;
    // Root mean square over images of expected less true signal, over that of the true ones: 0 unless an estimate.
    double bias = 0;

    double lamps_lit_mean = 0, lamps_lit_max = 0;  // of a row, in lamps at full level
    double white_share = 0;                        // counts of a white card over saturation, in the brightest row
    double lux_peak = 0, lux_mean = 0;  // on the chart: in the brightest basis slot, and over the whole cycle

    // Over the images that have signal at all.
    double mean_snr(const std::vector<double>& snr) const;
    int facing_image() const;  // the one with most signal
};

// Of a capture sequence, with its exposures, for the camera's noise and counts.
BasisFigures measure_basis(const Sequence& sequence, const StageConfig& stage, const CameraConfig& camera,
                           const GreyChart& chart);

}  // namespace ols
