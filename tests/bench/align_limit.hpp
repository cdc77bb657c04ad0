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

    // When every pixel is taken from where `path` leads (bilinear); or blended with the moment a cycle away across the target, where
    // its point is visible there, linearly in time.
    double moved_db(const MotionPath& path, Where where, bool interpolates) const;
    // As the pictures stand.
    double still_db(Where where) const;

  private:
    struct Moment {
        double tick;  // from the target's
        Image image;
        std::vector<unsigned char> visible, inside;
    };
    // Of the moments half a cycle away at most.
    template <typename Moved>
    double psnr_db(const Moved& moved, Where where) const;
    Image moved(const Moment& moment, const MotionPath& path) const;
    const Moment* across(const Moment& moment) const;

    double cycle_ticks_;
    Image truth_;
    double peak_;
    std::vector<Moment> moments_;  // the target's is not among them
};

}  // namespace ols
