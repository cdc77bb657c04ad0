// SPDX-License-Identifier: MIT
// From samples to a verdict.
#include "develop/parity_witness.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "develop/parity_sums.hpp"
#include "develop/row_hypotheses.hpp"
#include "stage/basis_inverse.hpp"
#include "stage/row_losses.hpp"

namespace ols {

namespace {

bool shows_single_lamps(const Basis& basis) {
    return std::ranges::all_of(basis.image_lamps, [](const auto& lamps) { return lamps.size() == 1; });
}

// What of the checks is left without some rows: all combinations that do not need them.
Eigen::MatrixXd checks_without(const Eigen::MatrixXd& checks, const std::vector<int>& lost_rows) {
    if (lost_rows.empty() || checks.cols() == 0) return checks;
    const Eigen::MatrixXd lost = checks(lost_rows, Eigen::all).transpose();  // d x lost
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(rank_tolerance);
    decomposition.compute(lost);
    const Eigen::MatrixXd all = decomposition.householderQ();
    Eigen::MatrixXd left = checks * all.rightCols(checks.cols() - decomposition.rank());
    for (const int row : lost_rows) left.row(row).setZero();
    return left;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

// Mean squared differences of rows from `last`, in units of two rows' noise. Sample by sample, as they lie in memory.
std::vector<double> changes_from(const Eigen::MatrixXf& last, const ParitySamples& samples) {
    Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(last.rows());
    double count = 0;
    for (Eigen::Index k = 0; k < last.cols(); ++k) {
        const double variance = double(samples.variance()(k));
        if (variance <= 0) continue;
        const auto now = samples.counts().col(k).array().cast<double>();
        squares += (now - last.col(k).array().cast<double>()).square() * (0.5 / variance);
        ++count;
    }
    squares /= count;
    return {squares.begin(), squares.end()};
}

}  // namespace

const char* row_fault_name(RowFault fault) {
    switch (fault) {
        case RowFault::swapped: return "swapped";
        case RowFault::copied: return "copied";
        case RowFault::mislit: return "mislit";
        case RowFault::changed: return "changed";
    }
    return "";
}

// Bisection of the complementary error function.
double normal_quantile(double chance) {
    assert(chance > 0 && chance < 0.5);
    double low = 0, high = 40;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (0.5 * std::erfc(middle / std::sqrt(2.0)) > chance ? low : high) = middle;
    }
    return high;
}

ParityWitness::ParityWitness(const Basis& basis) : basis_(basis), checks_(parity_checks(basis)) {
    if (!shows_single_lamps(basis)) return;
    inverse_.resize(basis.images(), basis.rows);
    for (int image = 0; image < basis.images(); ++image)
        for (int row = 0; row < basis.rows; ++row) inverse_(image, row) = basis.inverse(row, image);
}

// Mean squared difference of each row from the last target's, in units of two rows' noise: 1 but for what the subject, the lamps and
// the camera do, which is in all rows alike. The median tells that, and the spread about it how alike.
std::optional<RowFinding> ParityWitness::find_changed(const ParitySamples& samples,
                                                      const std::vector<int>& lost_rows) const {
    if (last_.cols() != samples.counts().cols()) return {};
    std::vector<double> changes = changes_from(last_, samples), known;
    for (const int row : lost_rows) changes[size_t(row)] = NAN;
    for (const double own : changes)
        if (std::isfinite(own)) known.push_back(own);
    if (known.size() < 3) return {};
    const double middle = median(known), count = double((samples.variance() > 0).count());
    for (double& value : known) value = std::abs(value - middle);
    const double spread = std::max(1.4826 * median(known), middle * std::sqrt(2 / count));
    // A chi-square is skewed, and by how much rows differ alike is not known better than its spread: twice a normal's reach.
    const double least = 2 * normal_quantile(false_alarms / basis_.rows);
    std::vector<int> changed;
    double most = 0;
    for (int row = 0; row < basis_.rows; ++row)
        if (const double far = (changes[size_t(row)] - middle) / spread; far > least)
            changed.push_back(row), most = std::max(most, far);
    if (changed.size() == 1) return RowFinding{RowFault::changed, {{changed[0]}}, -1, most, 1};
    if (changed.size() != 2) return {};  // none, or a subject that moved, or light that did
    Eigen::MatrixXf crossed_rows = last_;
    crossed_rows.row(changed[0]).swap(crossed_rows.row(changed[1]));
    const std::vector<double> exchanged = changes_from(crossed_rows, samples);
    const double crossed = std::max(exchanged[size_t(changed[0])], exchanged[size_t(changed[1])]);
    if ((crossed - middle) / spread < least) return RowFinding{RowFault::swapped, {changed}, -1, most, 1};
    return RowFinding{RowFault::changed, {{changed[0]}, {changed[1]}}, -1, most, 1};
}

// A row that is suspect is compared with the one before it, once: what stays as it has become is the subject.
void ParityWitness::remember(const ParitySamples& samples, const std::vector<int>& lost_rows,
                             const ParityVerdict& verdict) {
    std::vector<int> kept = lost_rows, suspect;
    if (verdict.finding)
        for (const auto& rows : verdict.finding->candidates) suspect.insert(suspect.end(), rows.begin(), rows.end());
    for (const int row : suspect)
        if (std::ranges::find(suspect_, row) == suspect_.end()) kept.push_back(row);
    suspect_ = suspect;
    if (last_.cols() != samples.counts().cols())
        last_ = Eigen::MatrixXf::Constant(samples.counts().rows(), samples.counts().cols(), NAN);
    if (kept.empty()) {
        last_ = samples.counts();
        return;
    }
    for (int row = 0; row < basis_.rows; ++row)
        if (std::ranges::find(kept, row) == kept.end()) last_.row(row) = samples.counts().row(row);
}

ParityVerdict ParityWitness::judge(const ParitySamples& samples, const std::vector<int>& lost_rows, bool stands_still,
                                   int threads) {
    ParityVerdict verdict;
    const Eigen::MatrixXd checks = checks_without(checks_, lost_rows);
    verdict.checks = int(checks.cols());
    if (checks.cols() > 0) {
        const std::vector<StripSums> strips = parity_sums(samples, checks, threads);
        double noise = 0, energy = 0, chi_square = 0;
        for (const StripSums& strip : strips) {
            verdict.samples += strip.samples;
            noise += strip.noise, energy += strip.checks.trace(), chi_square += strip.chi_square;
        }
        if (verdict.samples > 0) {
            const double d = double(checks.cols());
            verdict.chi_square = chi_square / (d * double(verdict.samples));
            verdict.weighted_chi_square = energy / (d * noise);
            const ParityEvidence evidence{basis_, checks, inverse_, strips, lost_rows};
            verdict.finding = find_copied(evidence);
            if (!verdict.finding) verdict.finding = find_swapped(evidence);
            if (!verdict.finding) verdict.finding = find_mislit(evidence);
        }
    } else {
        verdict.samples = size_t((samples.variance() > 0).count());
    }
    if (stands_still) {
        if (!verdict.names_surely())
            if (auto changed = find_changed(samples, lost_rows)) verdict.finding = std::move(changed);
        remember(samples, lost_rows, verdict);
    }
    return verdict;
}

}  // namespace ols
