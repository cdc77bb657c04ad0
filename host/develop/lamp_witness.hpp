// SPDX-License-Identifier: MIT
// Lamp witness: lamps that give less light than they should, told from the takes themselves.
//
// A lamp that is dark or dim in all of its slots makes no parity check speak: the rows are those of a subject with that much less under this
// lamp. What tells is the picture's mean under each lamp, x. Calibrated reflectance of a whole picture changes little from a lamp to its
// neighbours 18 degrees away, so that the others foretell each of them:
//     x_l - [K^-1 (x - m)]_l / [K^-1]_ll                 (the leave-one-out mean of a Gaussian process, Rasmussen and Williams 2006, eq. 5.12)
// with K the kernel of the estimates (fill_model.hpp) and m the mean. How far lamps are from what is foretold is the uncertainty that a factor is
// given with: their robust spread, and a third of the most that any lamp is above, since no lamp that fails is. Of a glossy or folded
// subject that is large, and less can be told; lamps whose failing would not stand out are counted. Against the first target of the
// take the subject's own unevenness cancels, and smaller changes show.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "develop/parity_samples.hpp"
#include "stage/basis.hpp"

namespace ols {

struct LampFinding {
    int image = 0;        // of the basis: a lamp, or several that are lit together
    double factor = 0;    // of the light that is foretold; noise may make it negative
    double spread = 0;    // standard deviation of such a factor over lamps that are as they should be
    bool is_new = false;  // it was brighter in the take's first target
    double sigma() const { return (1 - factor) / spread; }
};

class LampWitness {
  public:
    // A lamp is named that is so many spreads below what is foretold: almost three times as far as any is above. A flat sheet, whose light
    // ends in a sharp edge among the lamps, has lamps 7 below (tests/stability/suspect_slots.cpp).
    static constexpr double sigma_least = 8;
    static constexpr int lamps_max = 16;  // that may be named; beyond, the subject is not what is foretold

    LampWitness(const Basis& basis, const std::vector<LightPosition>& lamps);

    // Weakest first. Targets in their order, each once.
    std::vector<LampFinding> judge(const ParitySamples& samples);

    // Lamps of the last target that would not be named were they dark, by their neighbours: mostly those behind the subject.
    int unjudged() const { return unjudged_; }

  private:
    // What the others foretell of each image, without those of `left_out`.
    Eigen::VectorXd foretell(Eigen::VectorXd values, const std::vector<int>& left_out) const;
    struct Found {
        std::vector<LampFinding> lamps;
        int unjudged = 0;
    };
    // `unknown`: images of which there are no values. `noise`: the deviation of each value.
    Found find(const Eigen::VectorXd& values, std::vector<int> unknown, const Eigen::VectorXd& noise) const;

    const Basis& basis_;
    Eigen::MatrixXd precision_, inverse_;  // K^-1, images x images; images x rows
    Eigen::VectorXd first_;                // means of the first target
    int unjudged_ = 0;
};

}  // namespace ols
