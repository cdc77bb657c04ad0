// SPDX-License-Identifier: MIT
// How long a basis slot may be lit before a white card saturates.
#pragma once

#include <vector>

#include "stage/basis.hpp"
#include "stage/stage.hpp"

namespace ols {

// Counts a microsecond that each lamp of the sphere, alone and at full level, gives above black on a white surface (r = 1)
// at the centre that faces the camera: the camera's counts_per_us by the cosine, none from behind.
std::vector<double> white_card_counts_per_us(const std::vector<LightPosition>& lamps, const CameraConfig& camera);

// The longest exposure that the frame rate leaves: the paper's 412 us of 463 at 2160 frames a second (Wenger 3), as much
// time for reading out at others, or half the period where that is more.
double longest_exposure_us(double frame_rate_hz);

// The exposure where a sequence states none, in whole microseconds (of a grey basis, ticks a level) and at most
// longest_exposure_us(): the white card stays below saturation in the brightest row, by five standard deviations of its noise, in every camera of the stage. It is
// Wenger's step from 412 us for one lamp and for three to 100 us for half of them (5.3), decided for white instead of skin.
double derived_exposure_us(const Basis& basis, const StageConfig& stage, double frame_rate_hz);

}  // namespace ols
