// SPDX-License-Identifier: MIT
// Descent by pairs; a swap's change is read off the product of similarity and closeness, which is kept up to date.
#include "stage/slot_order.hpp"

#include <Eigen/Dense>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>

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

class Spreading {
  public:
    Spreading(const Basis& basis, const std::vector<int>& places, int slots)
        : similarity_(similarity_of(basis)), closeness_(closeness_of(places, slots)), order_(places.size()) {
        const int64_t stride = stride_of(basis.rows);
        for (int64_t p = 0; p < basis.rows; ++p) order_[size_t(p)] = int(p * stride % basis.rows);
        attraction_ = similarity_(Eigen::all, order_) * closeness_;
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
                if (change_of(a, b) < -least_gain_) {
                    swap(a, b);
                    swapped = true;
                }
        return swapped;
    }

    // Half of what the sum over all pairs of places changes by when the rows at a and b change places.
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

    MatrixXd similarity_, closeness_;
    MatrixXd attraction_;  // of a row by a place: over all places, similarity of the row there times closeness
    std::vector<int> order_;
    double least_gain_ = 0;
};

}  // namespace

std::vector<int> spread_rows(const Basis& basis, const std::vector<int>& places, int slots) {
    assert(int(places.size()) == basis.rows);
    return Spreading(basis, places, slots).descend();
}

}  // namespace ols
