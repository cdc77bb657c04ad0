// SPDX-License-Identifier: MIT
// What no alignment undoes: a subject that turns is lit anew, and what it hides comes to light.
#pragma once

#include <vector>

#include "motion_recording.hpp"

namespace ols {

// The scene in full colour at each pixel, under the lamps of the first of lightings(), without noise and without a basis, at the
// moments of the tracking frames around the first target: PSNR against the target's moment, as TrueTarget's.
class AlignLimit {
  public:
    AlignLimit(const Recording& recording, const MotionPath& true_path);

    // Which pixels count: those whose point is visible at either moment, or of these only those that are three pixels or
    // more from any other, where outlines have no say.
    enum class Where { visible, inside };

    // When every pixel is taken from where `path` leads (bilinear).
    double moved_db(const MotionPath& path, Where where) const;
    // As the pictures stand.
    double still_db(Where where) const;

  private:
    template <typename Moved>
    double psnr_db(const Moved& moved, Where where) const;

    Image truth_;
    double peak_;
    std::vector<Image> others_;                                 // by knot; the instant's is empty
    std::vector<std::vector<unsigned char>> visible_, inside_;  // by knot
};

}  // namespace ols
