// SPDX-License-Identifier: MIT
// Parity witness: whether the rows of a target are of one subject under the basis's patterns, and if not, which row it is that is wrong.
//
// Rows y = P x + noise, P rows x lamps of rank rows - d. The d columns of N (parity_checks()) span what no light of the lamps can
// make: z = N' y is noise, sample by sample, whatever the subject is. A row k that shows something else by e leaves z = N_k e, N_k row
// k of N. In an S-matrix with three columns to spare z are the images of the three lamps that are not there, N_k has 8 values, and
// no single sample tells more than to which of four classes of rows k belongs. What the samples of a picture tell together:
//  - swapped i, j: z = (N_i - N_j) (y_i - y_j), with the factor 1 and of every sample, from the rows as they were read.
//  - copied j in k: y_k - y_j is noise, as of no other pair of rows; of the two the wrong one is that in whose direction z lies.
//  - a lamp l that did not light in k, or did besides: z = -N_k x_l or N_k x_l, x_l = the lamp's own image.
// Each is a matched filter over the samples, and only sums of products of z and y are needed. Samples weigh 1 / (v + |z|^2 share / d),
// v the camera's noise: outlines of what moves have large z, from whatever cause, and would rule the sums. Sigmas are divided by the
// robust spread of the same figure over all hypotheses where that is above 1: what motion leaves is in all of them.
//
// A hypothesis that is accepted has more than sigma_least(), the normal quantile at which noise brings `false_alarms` a target over all
// hypotheses (Bonferroni), and explains more than no fault does: for a swap, sum (|z|^2 - |z - c s|^2) w > 0.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "develop/parity_samples.hpp"
#include "stage/basis.hpp"

namespace ols {

enum class RowFault {
    swapped,  // two rows have each other's picture
    copied,   // a row has another's picture
    mislit,   // a lamp was out, or on, against the pattern in one row
    changed,  // a row looks other than in the target before, while the others do not, of a subject that stands still: one of the two is wrong
};
const char* row_fault_name(RowFault fault);

struct RowFinding {
    RowFault fault;
    // What fits about equally well, best first: a pair if swapped; else a row each. One: it is named surely.
    std::vector<std::vector<int>> candidates;
    int lamp = -1;     // of mislit
    double sigma = 0;  // how far from what chance gives
    double share = 1;  // of the picture's height that differs
};

struct ParityVerdict {
    int checks = 0;      // d, less rows that are lost; 0: nothing can be said
    size_t samples = 0;  // that were looked at: on the grid, and not masked
    // Mean |z|^2 / v a check: 1 of a subject that stands still, as far as the camera's noise is what the stage says; and the same, of
    // weighted samples, which outlines do not rule: what is left of motion everywhere.
    double chi_square = 0, weighted_chi_square = 0;
    std::optional<RowFinding> finding;

    bool names_surely() const { return finding && finding->candidates.size() == 1; }
};

class ParityWitness {
  public:
    // Of a target, by chance, if noise is Gaussian.
    static constexpr double false_alarms = 1e-4;

    explicit ParityWitness(const Basis& basis);

    int checks() const { return int(checks_.cols()); }

    // `stands_still`: rows are compared with the last target's, too. Targets in their order, each once.
    ParityVerdict judge(const ParitySamples& samples, const std::vector<int>& lost_rows, bool stands_still,
                        int threads);

  private:
    std::optional<RowFinding> find_changed(const ParitySamples& samples, const std::vector<int>& lost_rows) const;
    void remember(const ParitySamples& samples, const std::vector<int>& lost_rows, const ParityVerdict& verdict);

    const Basis& basis_;
    Eigen::MatrixXd checks_;   // N, rows x d
    Eigen::MatrixXd inverse_;  // images x rows; empty where an image is not a lamp
    Eigen::MatrixXf
        last_;  // rows of the last target, those that were suspect of the one before; NaN where there are none
    std::vector<int> suspect_;  // rows of the last target
};

// What a normal variable of deviation 1 exceeds with the probability `chance`, below one half.
double normal_quantile(double chance);

}  // namespace ols
