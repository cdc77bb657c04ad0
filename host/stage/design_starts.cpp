// SPDX-License-Identifier: MIT
// Projective spaces, S-matrices, cyclic sets.
#include "stage/design_starts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <complex>
#include <numbers>
#include <numeric>
#include <set>

#include "stage/hadamard.hpp"
#include "stage/projective_space.hpp"

namespace ols {

namespace {

using Eigen::Index;

bool is_prime(int n) {
    for (int d = 2; d * d <= n; ++d)
        if (n % d == 0) return false;
    return n > 1;
}

BlockDesign projective_design(int dimension, int q, const std::vector<std::vector<int>>& points) {
    const auto v = Index(points.size());
    BlockDesign design{fmt::format("PG({}, {})", dimension, q), int(v), 0, Light::Zero(v, v)};
    for (Index r = 0; r < v; ++r)
        for (Index i = 0; i < v; ++i) design.light(r, i) = lies_on(points[size_t(i)], points[size_t(r)], q);
    design.k = int(design.light.row(0).sum());
    return design;
}

BlockDesign s_matrix_design(const std::string& name, const Signs& h) {
    BlockDesign design{name, h.n - 1, h.n / 2, Light(h.n - 1, h.n - 1)};
    for (int r = 1; r < h.n; ++r)
        for (int i = 1; i < h.n; ++i) design.light(r - 1, i - 1) = h.at(r, i) < 0;
    return design;
}

// Planar difference sets of prime-power order (J. Singer 1938; L. Baumert, "Cyclic Difference Sets", 1971), and the
// fourth powers modulo 37 (S. Chowla 1944).
struct DifferenceSet {
    const char* name;
    int v;
    std::vector<int> members;
};

const DifferenceSet difference_sets[] = {{"PG(2, 4)", 21, {3, 6, 7, 12, 14}},
                                         {"fourth powers 37", 37, {1, 7, 9, 10, 12, 16, 26, 33, 34}},
                                         {"PG(2, 8)", 73, {1, 2, 4, 8, 16, 32, 37, 55, 64}},
                                         {"PG(2, 9)", 91, {0, 1, 3, 9, 27, 49, 56, 61, 77, 81}}};

BlockDesign difference_set_design(const DifferenceSet& set) {
    BlockDesign design{set.name, set.v, int(set.members.size()), Light::Zero(set.v, set.v)};
    for (int r = 0; r < set.v; ++r)
        for (const int member : set.members) design.light(r, (r + member) % set.v) = 1;
    return design;
}

std::vector<int> shuffled(int count, std::mt19937_64& random) {
    std::vector<int> order(static_cast<size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[size_t(random() % i)]);
    return order;
}

// Numbers modulo n, with the Fourier coefficients of the set that they are.
class CyclicSet {
  public:
    CyclicSet(int n, int size, std::mt19937_64& random) : n_(n), taken_(size_t(n)), sums_(size_t(n)) {
        for (int k = 0; k < n; ++k) roots_.push_back(std::polar(1.0, 2 * std::numbers::pi * k / n));
        while (int(members_.size()) < size) {
            const int member = int(random() % uint64_t(n));
            if (taken_[size_t(member)]) continue;
            taken_[size_t(member)] = true;
            members_.push_back(member);
            for (size_t k = 0; k < sums_.size(); ++k) sums_[k] += root(k, member);
        }
        noise_ = noise_of(sums_);
    }

    const std::vector<int>& members() const { return members_; }

    // Moves a member elsewhere if that is less noisy.
    void try_move(size_t which, int to) {
        if (taken_[size_t(to)]) return;
        auto moved = sums_;
        for (size_t k = 0; k < moved.size(); ++k) moved[k] += root(k, to) - root(k, members_[which]);
        const double noise = noise_of(moved);
        if (!(noise < noise_)) return;
        taken_[size_t(members_[which])] = false;
        taken_[size_t(to)] = true;
        members_[which] = to;
        sums_ = std::move(moved);
        noise_ = noise;
    }

  private:
    std::complex<double> root(size_t k, int member) const { return roots_[k * size_t(member) % size_t(n_)]; }
    static double noise_of(const std::vector<std::complex<double>>& sums) {
        double noise = 0;
        for (const auto& sum : sums) noise += 1 / std::max(std::norm(sum), 1e-12);
        return noise;
    }

    int n_;
    std::vector<std::complex<double>> roots_;
    std::vector<int> members_;
    std::vector<bool> taken_;
    std::vector<std::complex<double>> sums_;
    double noise_ = 0;
};

Light with_rows(const Light& light, int rows) {
    Light more(rows, light.cols());
    for (Index r = 0; r < rows; ++r) more.row(r) = light.row(r % light.rows());
    return more;
}

}  // namespace

std::vector<BlockDesign> block_designs(int rows) {
    std::vector<BlockDesign> designs;
    for (int q = 2; q * q < rows; ++q)
        for (int d = 2; is_prime(q); ++d) {
            const auto points = projective_points(d, q, rows);
            if (int(points.size()) > rows) break;
            designs.push_back(projective_design(d, q, points));
        }
    for (const auto& set : difference_sets)
        if (set.v <= rows) designs.push_back(difference_set_design(set));
    for (int v = 3; v <= rows; v += 4) {
        const int half = (v - 1) / 2;
        if (is_prime(v)) designs.push_back(s_matrix_design(fmt::format("Paley {}", v), paley(v)));
        if (half % 4 == 3 && is_prime(half))
            designs.push_back(s_matrix_design(fmt::format("doubled Paley {}", half), sylvester_double(paley(half))));
    }
    std::stable_sort(designs.begin(), designs.end(), [](const auto& a, const auto& b) { return a.v < b.v; });
    return designs;
}

Light cyclic_light(int rows, int lamps, int lit, std::mt19937_64& random) {
    CyclicSet set(rows, lit, random);
    constexpr int trials = 4000;
    for (int trial = 0; trial < trials; ++trial)
        set.try_move(size_t(random() % uint64_t(lit)), int(random() % uint64_t(rows)));
    Light light = Light::Zero(rows, lamps);
    for (Index r = 0; r < rows; ++r)
        for (const int member : set.members()) {
            const Index lamp = (r + member) % rows;
            if (lamp < lamps) light(r, lamp) = 1;
        }
    return light;
}

namespace {

constexpr double rounding = 1e-9;
constexpr double grey_level_max = 255;

// "2 x a + b" of a, a, b.
std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (size_t from = 0, to = 0; from < names.size(); from = to) {
        while (to < names.size() && names[to] == names[from]) ++to;
        text += (from ? " + " : "") + (to - from > 1 ? fmt::format("{} x ", to - from) : "") + names[from];
    }
    return text;
}

// Designs side by side, each the largest that fits what is left and lights at most `lit` lamps; single lamps for the rest.
DesignStart side_by_side(const std::vector<BlockDesign>& designs, int lamps, int rows, int lit) {
    DesignStart start{"", Light::Zero(rows, lamps)};
    std::vector<std::string> names;
    int row = 0, lamp = 0;
    while (lamp < lamps) {
        const BlockDesign* best = nullptr;
        for (const auto& design : designs)
            if (design.k <= lit && design.v <= rows - row) best = &design;
        if (!best) break;
        const int columns = std::min(best->v, lamps - lamp);
        names.push_back(best->name);
        start.light.block(row, lamp, best->v, columns) = best->light.leftCols(columns);
        row += best->v;
        lamp += columns;
    }
    start.name = listed(names);
    for (; row < rows && lamp < lamps; ++row, ++lamp) start.light(row, lamp) = 1;
    for (int from = 0; row < rows; ++row, ++from) start.light.row(row) = start.light.row(from);
    return start;
}

// What is too bright loses lamps, or is dimmed as a row, which leaves what rows have in common as it is.
void fit_limits(const DesignProblem& problem, bool grey, Light& light) {
    for (Index r = 0; r < light.rows(); ++r) {
        if (const double share = exposure_share(problem, light.row(r)); grey && share < 1)
            light.row(r) = (light.row(r) * share * grey_level_max).array().floor() / grey_level_max;
        for (;;) {
            Eigen::RowVectorXd excess = Eigen::RowVectorXd::Zero(light.cols());
            if (problem.brightness_max > 0 && light.row(r).sum() > problem.brightness_max * (1 + rounding))
                excess.setOnes();
            for (Index card = 0; card < problem.cards.rows(); ++card)
                if (problem.cards.row(card).dot(light.row(r)) > problem.white_counts * (1 + rounding))
                    excess += problem.cards.row(card);
            Index brightest = 0;
            if (excess.cwiseProduct(light.row(r)).maxCoeff(&brightest) <= 0) break;
            light(r, brightest) = 0;
        }
    }
}

}  // namespace

std::vector<DesignStart> design_starts(const DesignProblem& problem, bool grey, uint64_t seed) {
    const int lamps = problem.lamps(), rows = problem.rows;
    std::vector<DesignStart> starts = {{"single", with_rows(Light::Identity(lamps, lamps), rows)}};
    const auto designs = block_designs(rows);
    std::set<std::string> seen;
    for (const auto& design : designs)
        if (design.v >= lamps) seen.insert(design.name);
    for (const auto& design : designs) {
        if (design.v >= lamps) {
            const Light light = design.light.leftCols(lamps);
            starts.push_back({design.name, with_rows(light, rows)});
            starts.push_back({design.name + ", dark for lit", with_rows(Light::Ones(design.v, lamps) - light, rows)});
        } else {
            auto start = side_by_side(designs, lamps, rows, design.k);
            if (seen.insert(start.name).second) starts.push_back(std::move(start));
        }
    }
    std::mt19937_64 random(seed);
    for (int lit = 2; lit <= (lamps + 1) / 2; lit += std::max(1, lit / 4))
        starts.push_back({fmt::format("cyclic {}", lit), cyclic_light(rows, lamps, lit, random)});
    const auto order = shuffled(lamps, random);
    for (auto& start : starts) {
        start.light = Light(start.light(Eigen::all, order));
        fit_limits(problem, grey, start.light);
    }
    std::erase_if(starts, [&](const DesignStart& start) { return !is_feasible(problem, start.light); });
    return starts;
}

}  // namespace ols
