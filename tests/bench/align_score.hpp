// SPDX-License-Identifier: MIT
// How near targets of a recording come to the truth of their moment, and the true motion to align them by.
#pragma once

#include <string>
#include <vector>

#include "motion_recording.hpp"

namespace ols {

// The value that this share of them is below; 0 of none.
double percentile(std::vector<float> values, double share);

// Light from a part of the sphere: a weight for each direction.
struct Lighting {
    std::string name;
    double (*weight)(Vec3 direction);
};

// A key light of a few lamps, a smooth environment, light that grazes from the side.
const std::vector<Lighting>& lightings();

// A recording's target as it should be.
class TrueTarget {
  public:
    // `lamps`: true_lamps().
    TrueTarget(const Recording& recording, const std::vector<std::vector<float>>& lamps);

    // Of the relit target against the relit truth over the pixels that show the subject: 20 log10(peak / rms), mean over the
    // lightings. Mosaics are compared as mosaics. Peak: the 99.9th percentile of the relit truth. The subject is where the truth
    // under all lamps is above 2 % of its 99.9th percentile. Pixels that are marked as misaligned count like all others.
    double psnr_db(const Target& target) const;

    // Of the pixels marked in `among`: rms of the relit target's error in percent of the peak, mean over the lightings; and the same
    // of the images that the target consists of, in percent of the 99.9th percentile of the brightest one.
    double relit_percent(const Target& target, const std::vector<unsigned char>& among) const;
    double images_percent(const Target& target, const std::vector<unsigned char>& among) const;

    // One lighting's picture: a mosaic.
    Image relit(const Target& target, const Lighting& lighting) const;
    const Image& relit_truth(size_t lighting) const { return truth_[lighting]; }
    double peak(size_t lighting) const { return peaks_[lighting]; }
    const std::vector<unsigned char>& subject() const { return subject_; }

  private:
    double relit_rms(const Target& target, size_t lighting, const std::vector<unsigned char>& among) const;
    Image mixed(const std::vector<const float*>& images, const std::vector<double>& weights) const;
    std::vector<double> weights(const Lighting& lighting) const;

    int width_, height_;
    std::vector<LightPosition> lights_;  // of the basis's images
    std::vector<std::vector<float>> images_;
    double image_peak_;
    std::vector<Image> truth_;  // by lighting
    std::vector<double> peaks_;
    std::vector<unsigned char> subject_;
};

// The true flow from the target's moment to its tracking frames' moments, in place of what would be found. Where nothing is seen,
// the nearest surface's flow; confidence is 1 where the point is visible at both ends, else 0.
MotionPath true_path(const Recording& recording, size_t target);

// The flow to a time between two of a path's knots, or at one.
FlowField flow_at(const MotionPath& path, double tick);

// The endpoint error in pixels of a found path at the true one's knots next to the target, or half a cycle from it, on either
// side, over the subject's pixels that are visible there. `found` null: of no flow, which is the length of the true one.
struct PathError {
    double mean = 0, percentile_95 = 0;
};
enum class Knots { nearest, half_a_cycle };
PathError path_error(const MotionPath* found, const MotionPath& truth, Knots knots, double cycle_ticks,
                     const std::vector<unsigned char>& subject);

// How far the subject's pixels go from half a cycle before the target to half a cycle after it.
struct CycleMotion {
    double mean_px = 0, most_px = 0;
};
CycleMotion cycle_motion(const MotionPath& truth, double cycle_ticks, const std::vector<unsigned char>& subject);

// The subject's pixels that move by more than a quarter of a pixel from the target to any knot, or are hidden there.
std::vector<unsigned char> moving_pixels(const MotionPath& truth, const std::vector<unsigned char>& subject);

// The path that a quality finds for a target, on one thread.
Result<MotionPath> found_path(const Recording& recording, size_t target, const MotionQuality& quality);

}  // namespace ols
