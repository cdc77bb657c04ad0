// SPDX-License-Identifier: MIT
// What no alignment undoes: a subject that turns is lit anew, and what it hides comes to light.
#pragma once

#include "motion_recording.hpp"

namespace ols {

// The scene in full colour at each pixel, under the lamps of the first of lightings(), without noise and without a basis, at the
// moments of the tracking frames around a target: how near it is to the target's moment as it stands, and when every pixel is
// taken from where the true flow leads (bilinear).
struct AlignLimit {
    double still_psnr_db = 0, moved_psnr_db = 0;
};

// `path`: true_path() of the first target. Over the pixels whose point is visible at either moment. PSNR as TrueTarget's.
AlignLimit align_limit(const Recording& recording, const MotionPath& path);

}  // namespace ols
