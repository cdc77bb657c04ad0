// SPDX-License-Identifier: MIT
// Descent by pairs. A swap's change in flicker is read off the product of similarity and closeness, which is kept up to date; its
// change in bursts off the windows around both places.
#include "stage/slot_order.hpp"

#include <Eigen/Dense>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>

#include "stage/row_losses.hpp"

namespace ols {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Whole numbers held in doubles: entries of both matrices are at most this large, so four sums of their products over the
// 1024 rows that a program can have stay below 2^53 and are exact, whatever the order of addition.
constexpr double unit = 1 << 20;
constexpr int sweeps_max = 50;

int stride_of(int rows) {
    const double ideal = rows / std::numbers::phi;
    int best = 1;
    for (int q = 1; q < rows; ++q)
        if (std::gcd(q, rows) == 1 && std::abs(q - ideal) < std::abs(best - ideal)) best = q;
    return best;
}

MatrixXd in_units(const MatrixXd& matrix) {
    return (matrix * (unit / matrix.cwiseAbs().maxCoeff())).array().round();
}

// Of two rows: how much light of the same lamps they hold, as shares of each lamp's light; and how much of all light.
MatrixXd similarity_of(const Basis& basis) {
    MatrixXd light(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int i = 0; i < basis.lamps; ++i) light(r, i) = basis.level(r, i);
    const Eigen::VectorXd whole = light.rowwise().sum() / light.sum();
    for (int i = 0; i < basis.lamps; ++i) light.col(i) /= std::max(1.0, light.col(i).sum());
    return in_units(light * light.transpose() / basis.lamps + whole * whole.transpose());
}

MatrixXd closeness_of(const std::vector<int>& places, int slots) {
    const auto n = Index(places.size());
    MatrixXd closeness(n, n);
    for (Index p = 0; p < n; ++p)
        for (Index q = 0; q < n; ++q) {
            const double d = std::abs(places[size_t(p)] - places[size_t(q)]) / double(slots);
            closeness(p, q) = d * d - d + 1 / 6.0;
        }
    return in_units(closeness);
}

// Counts the bursts of an order that the other rows do not make up for; one pair of neighbours outweighs all longer ones.
class LostBursts {
  public:
    explicit LostBursts(const Basis& basis) : losses_(basis), rows_(size_t(basis.rows)) {
        if (losses_.redundancy() < 2) return;
        lost_pairs_.resize(rows_ * rows_);
        for (size_t i = 0; i < rows_; ++i)
            for (size_t j = 0; j < rows_; ++j)
                lost_pairs_[i * rows_ + j] = i == j || !losses_.makes_up_for(std::array{int(i), int(j)});
    }

    int64_t count(const std::vector<int>& order) const {
        int64_t sum = 0;
        for (size_t first = 0; first < rows_; ++first) sum += beginning_at(first, order);
        return sum;
    }

    // Those that a row at one of two places is part of, and some others that it is not.
    int64_t count_around(size_t a, size_t b, const std::vector<int>& order) const {
        int64_t sum = 0;
        for (size_t back = 0; back < longest; ++back) {
            const size_t first = (a + rows_ - back) % rows_;
            sum += beginning_at(first, order);
            const size_t other = (b + rows_ - back) % rows_;
            if ((a + rows_ - other) % rows_ >= longest) sum += beginning_at(other, order);  // not counted for a already
        }
        return sum;
    }

  private:
    static constexpr size_t longest = 3;  // beginning_at() looks at three rows
    static_assert(longest == RowLosses::rows_max);

    bool is_lost(int i, int j) const { return lost_pairs_[size_t(i) * rows_ + size_t(j)]; }

    int64_t beginning_at(size_t first, const std::vector<int>& order) const {
        if (lost_pairs_.empty()) return 0;
        const int i = order[first], j = order[(first + 1) % rows_], k = order[(first + 2) % rows_];
        const bool neighbours = is_lost(i, j), at_two = is_lost(i, k);
        const bool three = losses_.redundancy() >= 3 &&
                           (neighbours || at_two || is_lost(j, k) || !losses_.makes_up_for(std::array{i, j, k}));
        return neighbours * int64_t(2 * rows_ + 1) + at_two + three;
    }

    RowLosses losses_;
    size_t rows_;
    std::vector<uint8_t> lost_pairs_;  // rows x rows; empty where no two rows can be spared
};

class Spreading {
  public:
    Spreading(const Basis& basis, const std::vector<int>& places, int slots)
        : lost_bursts_(basis),
          similarity_(similarity_of(basis)),
          closeness_(closeness_of(places, slots)),
          order_(places.size()) {
        const int64_t stride = stride_of(basis.rows);
        for (int64_t p = 0; p < basis.rows; ++p) order_[size_t(p)] = int(p * stride % basis.rows);
        attraction_ = similarity_(Eigen::all, order_) * closeness_;
        lost_ = lost_bursts_.count(order_);
        least_gain_ = closeness_(0, 0) * similarity_.trace() * 1e-6;
    }

    std::vector<int> descend() {
        for (int sweep = 0; sweep < sweeps_max && sweep_once(); ++sweep) {
        }
        return order_;
    }

  private:
    bool sweep_once() {
        bool swapped = false;
        const auto n = Index(order_.size());
        for (Index a = 0; a < n; ++a)
            for (Index b = a + 1; b < n; ++b)
                if (swap_if_better(a, b)) swapped = true;
        return swapped;
    }

    bool swap_if_better(Index a, Index b) {
        const bool is_more_even = change_of(a, b) < -least_gain_;
        if (!is_more_even && lost_ == 0) return false;
        const int64_t before = lost_bursts_.count_around(size_t(a), size_t(b), order_);
        std::swap(order_[size_t(a)], order_[size_t(b)]);
        const int64_t after = lost_bursts_.count_around(size_t(a), size_t(b), order_);
        std::swap(order_[size_t(a)], order_[size_t(b)]);
        if (after > before || (after == before && !is_more_even)) return false;
        lost_ += after - before;
        swap(a, b);
        return true;
    }

    // Half of what the unevenness, a sum over all pairs of places, changes by when the rows at a and b change places.
    double change_of(Index a, Index b) const {
        const int i = order_[size_t(a)], j = order_[size_t(b)];
        return attraction_(j, a) - attraction_(j, b) - attraction_(i, a) + attraction_(i, b) +
               (closeness_(a, a) - closeness_(a, b)) * (similarity_(i, i) + similarity_(j, j) - 2 * similarity_(i, j));
    }

    void swap(Index a, Index b) {
        const int i = order_[size_t(a)], j = order_[size_t(b)];
        attraction_.noalias() +=
            (similarity_.col(j) - similarity_.col(i)) * (closeness_.col(a) - closeness_.col(b)).transpose();
        std::swap(order_[size_t(a)], order_[size_t(b)]);
    }

    LostBursts lost_bursts_;
    MatrixXd similarity_, closeness_;
    MatrixXd attraction_;  // of a row by a place: over all places, similarity of the row there times closeness
    std::vector<int> order_;
    double least_gain_ = 0;
    int64_t lost_ = 0;  // bursts of the order
};

}  // namespace

std::vector<int> spread_rows(const Basis& basis, const std::vector<int>& places, int slots) {
    assert(int(places.size()) == basis.rows);
    return Spreading(basis, places, slots).descend();
}

}  // namespace ols
