// SPDX-License-Identifier: MIT
// Matched filters on sums of products.
#include "develop/row_hypotheses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace ols {

namespace {

// A candidate whose evidence is less than the best one's by more than so many of its deviations is ruled out.
constexpr double rival_sigma = 4;
// With more pairs than that left, pairs of this subject are not told apart: of a flat one, which looks the same in all rows but for its
// brightness, what motion leaves fits dozens.
constexpr size_t pairs_max = 8;

// Vectors N_k that are parallel to this share of their length are one direction.
constexpr double parallel = 1e-6;

struct Pair {
    int i, j;
};

// Unordered pairs of rows that were recorded and have different patterns.
std::vector<Pair> pairs_of(const ParityEvidence& evidence) {
    const Basis& basis = evidence.basis;
    std::vector<Pair> pairs;
    const auto is_lost = [&](int row) { return std::ranges::binary_search(evidence.lost_rows, row); };
    for (int i = 0; i < basis.rows; ++i)
        for (int j = i + 1; j < basis.rows && !is_lost(i); ++j) {
            const auto begin = basis.levels.begin();
            const bool same = std::equal(begin + ptrdiff_t(i) * basis.lamps, begin + ptrdiff_t(i + 1) * basis.lamps,
                                         begin + ptrdiff_t(j) * basis.lamps);
            if (!same && !is_lost(j)) pairs.push_back({i, j});
        }
    return pairs;
}

// sum w (y_i - y_j)^2
double difference(const StripSums& strip, const Pair& pair) {
    return double(strip.rows(pair.i, pair.i)) + double(strip.rows(pair.j, pair.j)) -
           2 * double(strip.rows(pair.j, pair.i));
}

// Of the whole picture, or of strips first to last.
struct RunSums {
    double noise = 0, energy = 0;  // sum w v, sum w |z|^2
    Eigen::MatrixXd checks;
};
RunSums run_sums(const ParityEvidence& evidence, int first, int last) {
    RunSums run;
    run.checks = Eigen::MatrixXd::Zero(evidence.checks.cols(), evidence.checks.cols());
    for (int s = first; s <= last; ++s) {
        const StripSums& strip = evidence.strips[size_t(s)];
        run.noise += strip.noise;
        run.checks += strip.checks;
    }
    run.energy = run.checks.trace();
    return run;
}

// Of z along N_k, in sums of w z z'.
double energy_along(const RunSums& run, const Eigen::VectorXd& direction) {
    const double square = direction.squaredNorm();
    return square > 0 ? double(direction.transpose() * run.checks * direction) / square : 0;
}

// sum w y_i y_k - sum w y_j y_k for all k.
Eigen::VectorXd row_of_difference(const StripSums& strip, const Pair& pair) {
    const auto row = [&](int i) {
        Eigen::VectorXd own = strip.rows.col(i).cast<double>();
        own.head(i) = strip.rows.row(i).head(i).transpose().cast<double>();
        return own;
    };
    const double means = strip.mean_rows(pair.i) - strip.mean_rows(pair.j);
    return (row(pair.i) - row(pair.j)).array() + means;
}

// Of the sigmas of all pairs, when this one's swap is undone in a run of strips: pictures of one subject under half of the lamps are much
// alike, so that a swap shows in the sigmas of all pairs.
double spread_without(const ParityEvidence& evidence, const std::vector<Pair>& pairs, const Pair& undone, int first,
                      int last) {
    const Eigen::VectorXd c = evidence.checks.row(undone.i) - evidence.checks.row(undone.j);
    const Eigen::Index rows = evidence.checks.rows();
    Eigen::MatrixXd check_rows = Eigen::MatrixXd::Zero(c.size(), rows), squares = Eigen::MatrixXd::Zero(rows, rows);
    double noise = 0;
    for (int s = first; s <= last; ++s) {
        const StripSums& strip = evidence.strips[size_t(s)];
        check_rows += strip.check_rows - c * row_of_difference(strip, undone).transpose();
        squares += strip.rows.cast<double>(), noise += strip.noise;
    }
    const Eigen::MatrixXd product = evidence.checks * check_rows;
    std::vector<double> sigmas;
    for (const auto& [i, j] : pairs) {
        if (i == undone.i || i == undone.j || j == undone.i || j == undone.j) continue;
        const double c2 = (evidence.checks.row(i) - evidence.checks.row(j)).squaredNorm();
        const double square = squares(i, i) + squares(j, j) - 2 * squares(j, i);
        if (c2 * square <= 0) continue;
        const double a = product(i, i) - product(i, j) - product(j, i) + product(j, j);
        sigmas.push_back((a - c2 * noise) / std::sqrt(c2 * square));
    }
    return robust_spread(std::move(sigmas));
}

}  // namespace

double robust_spread(std::vector<double> values) {
    if (values.empty()) return 1;
    for (double& value : values) value = std::abs(value);
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return std::max(1.0, 1.4826 * *middle);
}

// y_i - y_j has the energy 2 n of noise, n = sum w v, with a deviation of sqrt(8 n) in units of the noise. By how much the pair's is above
// that, with four deviations for safety, must be less than half of that of any pair without i and j: where patterns look alike,
// as in the dark, there is no such pair.
std::optional<RowFinding> find_copied(const ParityEvidence& evidence) {
    const std::vector<Pair> pairs = pairs_of(evidence);
    std::vector<std::vector<double>> excesses;  // of each strip's pairs
    for (const StripSums& strip : evidence.strips) {
        auto& excess = excesses.emplace_back();
        for (const Pair& pair : pairs) excess.push_back(difference(strip, pair) - 2 * strip.noise);
    }
    std::optional<RowFinding> found;
    for (int first = 0; first < parity_strips; ++first) {
        std::vector<double> excess(pairs.size());
        for (int last = first; last < parity_strips; ++last) {
            for (size_t p = 0; p < pairs.size(); ++p) excess[p] += excesses[size_t(last)][p];
            const double share = double(last - first + 1) / parity_strips;
            if (found && found->share >= share) continue;
            const RunSums run = run_sums(evidence, first, last);
            const double deviation = std::sqrt(8 * run.noise);
            const size_t least = size_t(std::ranges::min_element(excess) - excess.begin());
            const Pair pair = pairs[least];
            double next = INFINITY;
            for (size_t p = 0; p < pairs.size(); ++p)
                if (pairs[p].i != pair.i && pairs[p].i != pair.j && pairs[p].j != pair.i && pairs[p].j != pair.j)
                    next = std::min(next, excess[p]);
            if (run.noise == 0 || std::max(excess[least], 0.0) + rival_sigma * deviation > next / 2) continue;

            // Which of the two: e |N_k|^2 lies along N_k, and only its share cos^2 along the other's.
            const Eigen::VectorXd a = evidence.checks.row(pair.i), b = evidence.checks.row(pair.j);
            const double cosine = a.norm() * b.norm() > 0 ? a.dot(b) / (a.norm() * b.norm()) : 1;
            const double scale = std::max(1.0, (run.energy) / (double(evidence.checks.cols()) * run.noise));
            const double sines = 1 - cosine * cosine;
            const double more = sines > parallel ? (energy_along(run, a) - energy_along(run, b)) /
                                                       (2 * scale * std::sqrt(sines * run.noise))
                                                 : 0;
            found = RowFinding{RowFault::copied, {}, -1, (next - excess[least]) / deviation, share};
            if (more >= -rival_sigma) found->candidates.push_back({pair.i});
            if (more <= rival_sigma) found->candidates.push_back({pair.j});
            if (more < 0) std::ranges::reverse(found->candidates);
        }
    }
    return found;
}

// With c = N_i - N_j and s = y_i - y_j: A = sum w s c'z, S = sum w s^2. Noise alone makes A = c^2 n of no fault and of a swap S c^2 - c^2 n,
// so that L = 2 A - c^2 S is minus and plus the same; the deviation of A is |c| sqrt(S), times that of z. Torn frames: of each pair
// the run of strips with the largest L. With c = 0 a pair is silent.
std::optional<RowFinding> find_swapped(const ParityEvidence& evidence) {
    struct Candidate {
        Pair pair;
        double evidence, sigma, deviation;
        int first, last;  // strip
    };
    const std::vector<Pair> pairs = pairs_of(evidence);
    const auto count = evidence.strips.size();
    std::vector<Eigen::MatrixXd> products;  // N_i . sum w z y_j
    for (const StripSums& strip : evidence.strips) products.push_back(evidence.checks * strip.check_rows);
    std::vector<Candidate> candidates;
    for (const Pair& pair : pairs) {
        const auto [i, j] = pair;
        const double c2 = (evidence.checks.row(i) - evidence.checks.row(j)).squaredNorm();
        if (c2 < parallel * evidence.checks.row(i).squaredNorm()) continue;
        struct Run {
            double a = 0, square = 0, noise = 0, energy = 0;
            int first = 0, last = -1;
            double likelihood(double c2) const { return 2 * a - c2 * square; }
        };
        Run run, best;  // Kadane's: the run of strips with the largest sum
        for (size_t s = 0; s < count; ++s) {
            if (run.likelihood(c2) <= 0) run = {.first = int(s)};
            const Eigen::MatrixXd& product = products[s];
            run.a += product(i, i) - product(i, j) - product(j, i) + product(j, j);
            run.square += difference(evidence.strips[s], pair), run.noise += evidence.strips[s].noise;
            run.energy += evidence.strips[s].checks.trace(), run.last = int(s);
            if (best.last < 0 || run.likelihood(c2) > best.likelihood(c2)) best = run;
        }
        if (best.likelihood(c2) <= 0) continue;
        const double left = (best.energy - best.likelihood(c2)) / (double(evidence.checks.cols()) * best.noise);
        const double deviation = std::sqrt(c2 * best.square * std::max(1.0, left));
        candidates.push_back(
            {pair, best.likelihood(c2), (best.a - c2 * best.noise) / deviation, 2 * deviation, best.first, best.last});
    }
    if (candidates.empty()) return {};
    std::ranges::sort(candidates, std::ranges::greater(), &Candidate::evidence);
    const Candidate best = candidates.front();
    const double spread = spread_without(evidence, pairs, best.pair, best.first, best.last);
    const double runs = double(count * (count + 1)) / 2;
    const double least = normal_quantile(ParityWitness::false_alarms / (double(pairs.size()) * runs));
    if (best.sigma / spread < least) return {};
    RowFinding finding{
        RowFault::swapped, {}, -1, best.sigma / spread, double(best.last - best.first + 1) / double(count)};
    for (const Candidate& one : candidates)
        if (best.evidence - one.evidence <= rival_sigma * spread * best.deviation / 2)
            finding.candidates.push_back({one.pair.i, one.pair.j});
    if (finding.candidates.size() > pairs_max) return {};
    return finding;
}

// x_l = W_l y; with u a direction of N: A = sum w x_l u'z, S = sum w x_l^2, and A = -u^2 S where the lamp was out in a row with N_k = u. Rows whose
// N_k is u and that light the lamp are not told apart, nor from them those with N_k = -u that do not and in which it was on.
std::optional<RowFinding> find_mislit(const ParityEvidence& evidence) {
    if (evidence.inverse.size() == 0) return {};
    const Eigen::Index rows = evidence.checks.rows(), lamps = evidence.inverse.rows();
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(rows, rows),
                    check_rows = Eigen::MatrixXd::Zero(evidence.checks.cols(), rows);
    Eigen::VectorXd mean_rows = Eigen::VectorXd::Zero(rows);
    double mean_square = 0;
    for (const StripSums& strip : evidence.strips) {
        square += strip.rows.cast<double>().selfadjointView<Eigen::Lower>();
        mean_rows += strip.mean_rows, mean_square += strip.mean_square, check_rows += strip.check_rows;
    }
    const RunSums whole = run_sums(evidence, 0, parity_strips - 1);
    const Eigen::MatrixXd& w = evidence.inverse;
    const Eigen::VectorXd sums = w.rowwise().sum(), crossed = w * mean_rows;
    const Eigen::MatrixXd images = w * square;  // times W' and with the means: sum w x x'
    const Eigen::VectorXd energies =
        images.cwiseProduct(w).rowwise().sum() + 2 * crossed.cwiseProduct(sums) + mean_square * sums.cwiseAbs2();
    const Eigen::MatrixXd products = check_rows * w.transpose();  // sum w z x_l, d x lamps
    const double scale = std::max(1.0, whole.energy / (double(evidence.checks.cols()) * whole.noise));

    std::vector<Eigen::VectorXd> directions;
    for (Eigen::Index row = 0; row < rows; ++row) {
        const Eigen::VectorXd own = evidence.checks.row(row);
        const auto is_parallel = [&](const Eigen::VectorXd& u) {
            return std::min((own - u).norm(), (own + u).norm()) < parallel * own.norm();
        };
        if (own.norm() > parallel && std::ranges::none_of(directions, is_parallel)) directions.push_back(own);
    }
    struct Candidate {
        size_t direction = 0;
        Eigen::Index lamp = 0;
        double factor = 0, sigma = 0;
    } best;
    const auto sigma_of = [&](const Eigen::VectorXd& u, Eigen::Index lamp, double a) {
        return energies(lamp) > 0 ? a / std::sqrt(u.squaredNorm() * energies(lamp) * scale) : 0;
    };
    for (size_t u = 0; u < directions.size(); ++u)
        for (Eigen::Index lamp = 0; lamp < lamps; ++lamp) {
            const double a = directions[u].dot(products.col(lamp)), sigma = sigma_of(directions[u], lamp, a);
            if (std::abs(sigma) > std::abs(best.sigma))
                best = {u, lamp, a / (directions[u].squaredNorm() * energies(lamp)), sigma};
        }
    if (best.sigma == 0) return {};
    // Of the others, when this lamp's part is taken out.
    const Eigen::VectorXd with_best = images * w.row(best.lamp).transpose() + crossed * sums(best.lamp) +
                                      sums * crossed(best.lamp) + mean_square * sums(best.lamp) * sums;
    std::vector<double> sigmas;
    for (const Eigen::VectorXd& u : directions)
        for (Eigen::Index lamp = 0; lamp < lamps; ++lamp)
            sigmas.push_back(sigma_of(
                u, lamp,
                u.dot(products.col(lamp)) - best.factor * u.dot(directions[best.direction]) * with_best(lamp)));
    const double spread = robust_spread(sigmas);
    const double least = normal_quantile(ParityWitness::false_alarms / (2 * double(sigmas.size())));
    // A factor of 1, to a half: less is explained better by no fault, more by something else than this lamp.
    if (std::abs(best.sigma) / spread < least || std::abs(std::abs(best.factor) - 1) > 0.5) return {};
    RowFinding finding{
        RowFault::mislit, {}, evidence.basis.image_lamps[size_t(best.lamp)][0], std::abs(best.sigma) / spread, 1};
    const Eigen::VectorXd& u = directions[best.direction];
    for (Eigen::Index row = 0; row < rows; ++row) {
        const Eigen::VectorXd own = evidence.checks.row(row);
        const int sign = (own - u).norm() < parallel * u.norm() ? 1 : (own + u).norm() < parallel * u.norm() ? -1 : 0;
        const bool is_out = sign * best.factor < 0;
        if (sign != 0 && is_out == evidence.basis.lit(int(row), finding.lamp)) finding.candidates.push_back({int(row)});
    }
    if (finding.candidates.empty()) return {};
    return finding;
}

}  // namespace ols
