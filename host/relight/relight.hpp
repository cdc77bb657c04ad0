// SPDX-License-Identifier: MIT
// Relighting: the weighted sum of a subject's OLAT images.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "image/frame.hpp"
#include "image/plane.hpp"
#include "relight/lamp_weights.hpp"
#include "result.hpp"

namespace ols {

// OLAT images as an archive's target holds them: one plane of height x width values a lamp (mosaic or monochrome), or
// three (Cfa::rgb), lamp by lamp.
struct OlatImages {
    int width = 0, height = 0;
    Cfa cfa = Cfa::none;
    std::span<const Plane> planes;

    int planes_per_lamp() const { return cfa == Cfa::rgb ? 3 : 1; }
    int lamps() const { return int(planes.size()) / planes_per_lamp(); }
};

struct RelitImage {
    Image image;  // one channel where the OLAT images are mosaics (still a mosaic), else three
    // Samples that were NaN or Inf, for each lamp; they were left out, so that their light is missing from the image.
    std::vector<size_t> left_out_samples;
};

// I = 1/pi sum_i r_i weight_i (Debevec et al. 2000, section 3.4). A mosaic's pixel takes the weights of the colour it sees, a
// monochrome image is lit in three colours. Every pixel is summed in single precision in the order of the lamps, so that
// the result does not depend on the number of threads (0: as many as there are cores). Errors: plane sizes or lamp counts that do not fit.
Result<RelitImage> relight(const OlatImages& olat, const LampWeights& weights, int threads = 0);

}  // namespace ols
