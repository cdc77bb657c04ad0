// SPDX-License-Identifier: MIT
// Coordinate exchange on the rows of a light.
#include <algorithm>
#include <cmath>
#include <limits>

#include "stage/design_search.hpp"

namespace ols {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Columns2 = Eigen::Matrix<double, Eigen::Dynamic, 2>;

// A change of one or two levels of a row; j < 0: of one.
struct Change {
    Index i = -1, j = -1;
    double by_i = 0, by_j = 0;
    double cost_change = 0;
};

class Exchange {
  public:
    Exchange(const DesignProblem& problem, Light light, int level_max)
        : problem_(problem), light_(std::move(light)), level_max_(level_max) {
        refresh();
    }

    const Light& light() const { return light_; }
    double cost() const { return cost_.cost; }

    // Whether any row changed.
    bool sweep() {
        bool changed = false;
        for (Index r = 0; r < light_.rows(); ++r) {
            enter_row(r);
            constexpr int changes_max = 4;  // then other rows have their turn
            for (int count = 0; count < changes_max; ++count) {
                const Change change = best_change();
                if (change.i < 0) break;
                apply(change);
                changed = true;
            }
        }
        refresh();
        return changed;
    }

  private:
    // Everything anew, so that rounding does not gather.
    void refresh() {
        cost_ = design_cost(problem_, light_);
        covariance_ = cost_.covariance;
        weighted_ = covariance_ * cost_.lamp_weights.asDiagonal() * covariance_;
        duty_ = light_.colwise().sum();
    }

    void enter_row(Index r) {
        row_ = r;
        read_row();
    }

    void read_row() {
        const VectorXd row = light_.row(row_);
        variance_ = cost_.row_variances(row_);
        row_counts_ = problem_.subjects * row;
        if (problem_.cards.rows() > 0) card_counts_ = problem_.cards * row;
        level_sum_ = row.sum();
        along_covariance_ = covariance_ * row;
        along_weighted_ = weighted_ * row;
        row_covariance_ = row.dot(along_covariance_);
        row_weighted_ = row.dot(along_weighted_);
    }

    double by_j(const Change& change) const { return change.j < 0 ? 0 : change.by_j; }

    bool allowed(const Change& change) const {
        const auto in_range = [&](Index lamp, double by) {
            const double level = light_(row_, lamp) + by;
            return level > -1e-9 && level < 1 + 1e-9 &&
                   (by < 0 || duty_(lamp) + by <= problem_.duty_max * double(light_.rows()));
        };
        if (!in_range(change.i, change.by_i) || (change.j >= 0 && !in_range(change.j, change.by_j))) return false;
        if (problem_.brightness_max > 0 &&
            level_sum_ + change.by_i + by_j(change) > problem_.brightness_max * (1 + 1e-9))
            return false;
        for (Index card = 0; card < problem_.cards.rows(); ++card) {
            double counts = card_counts_(card) + change.by_i * problem_.cards(card, change.i);
            if (change.j >= 0) counts += change.by_j * problem_.cards(card, change.j);
            if (counts > problem_.white_counts) return false;
        }
        return true;
    }

    double variance_after(const Change& change) const {
        double sum = 0;
        for (Index k = 0; k < row_counts_.size(); ++k) {
            double counts = row_counts_(k) + change.by_i * problem_.subjects(k, change.i);
            if (change.j >= 0) counts += change.by_j * problem_.subjects(k, change.j);
            const double sigma = problem_.noise.read_counts + problem_.noise.shot * std::sqrt(std::max(counts, 0.0));
            sum += sigma * sigma;
        }
        return sum / double(row_counts_.size());
    }

    // x' Q x, x' Q y and y' Q y of the row x and the changed row y, from what is known of Q x.
    Eigen::Matrix2d products(const MatrixXd& q, const VectorXd& along, double square, const Change& change) const {
        double across = square + change.by_i * along(change.i);
        double changed = across + change.by_i * along(change.i) + change.by_i * change.by_i * q(change.i, change.i);
        if (change.j >= 0) {
            const double step = change.by_j * along(change.j);
            across += step;
            changed += 2 * step + change.by_j * change.by_j * q(change.j, change.j) +
                       2 * change.by_i * change.by_j * q(change.i, change.j);
        }
        return Eigen::Matrix2d{{square, across}, {across, changed}};
    }

    // F gains y y' / s_y and loses x x' / s_x: C' = C - C V K V' C with V = [x y], K = (D + V' C V)^-1 and
    // D = diag(-s_x, s_y), so the cost falls by the trace of K V' A V.
    Eigen::Matrix2d middle(const Change& change, double variance) const {
        Eigen::Matrix2d m = products(covariance_, along_covariance_, row_covariance_, change);
        m(0, 0) -= variance_;
        m(1, 1) += variance;
        return m;
    }

    double cost_change(const Change& change) const {
        const double variance = variance_after(change);
        const Eigen::Matrix2d m = middle(change, variance);
        // The determinant is -s_x s_y times what F's determinant is multiplied by: positive, or the rank is lost.
        const double determinant = m.determinant();
        if (determinant > -1e-9 * variance_ * variance) return std::numeric_limits<double>::infinity();
        const Eigen::Matrix2d a = products(weighted_, along_weighted_, row_weighted_, change);
        return -(a(0, 0) * m(1, 1) - 2 * a(0, 1) * m(0, 1) + a(1, 1) * m(0, 0)) / determinant;
    }

    void consider(Change change, Change& best) const {
        if (!allowed(change)) return;
        change.cost_change = cost_change(change);
        if (change.cost_change < best.cost_change) best = change;
    }

    Change best_change() const {
        Change best;
        best.cost_change = -1e-9 * cost_.cost;  // less is rounding
        for (Index i = 0; i < light_.cols(); ++i) {
            const double level = light_(row_, i);
            if (level_max_ == 1) {
                consider({i, -1, level > 0.5 ? -1.0 : 1.0, 0, 0}, best);
                continue;
            }
            for (const double by : {-level, 1 - level}) consider({i, -1, by, 0, 0}, best);
            for (const int step : {1, 4, 16, 64})
                for (const int sign : {-1, 1}) consider({i, -1, double(sign * step) / level_max_, 0, 0}, best);
        }
        if (best.i >= 0) return best;  // pairs cost more to look at: only where no single change helps
        for (Index i = 0; i < light_.cols(); ++i)
            for (Index j = 0; j < light_.cols() && light_(row_, i) > 0; ++j)
                if (light_(row_, j) == 0) consider({i, j, -light_(row_, i), light_(row_, i), 0}, best);
        return best;
    }

    void apply(const Change& change) {
        const double variance = variance_after(change);
        const Eigen::Matrix2d k = middle(change, variance).inverse();
        Columns2 g(light_.cols(), 2), h(light_.cols(), 2);
        g.col(0) = along_covariance_, h.col(0) = along_weighted_;
        g.col(1) = along_covariance_ + change.by_i * covariance_.col(change.i);
        h.col(1) = along_weighted_ + change.by_i * weighted_.col(change.i);
        if (change.j >= 0) {
            g.col(1) += change.by_j * covariance_.col(change.j);
            h.col(1) += change.by_j * weighted_.col(change.j);
        }
        const Eigen::Matrix2d a = products(weighted_, along_weighted_, row_weighted_, change);
        const Columns2 gk = g * k;
        const MatrixXd cross = gk * h.transpose();
        covariance_ -= gk * g.transpose();
        weighted_ += gk * a * gk.transpose() - cross - cross.transpose();
        cost_.cost += change.cost_change;
        cost_.row_variances(row_) = variance;
        set_level(change.i, change.by_i);
        if (change.j >= 0) set_level(change.j, change.by_j);
        read_row();
    }

    void set_level(Index lamp, double by) {
        const double before = light_(row_, lamp);
        light_(row_, lamp) = std::round((before + by) * level_max_) / level_max_;
        duty_(lamp) += light_(row_, lamp) - before;
    }

    const DesignProblem& problem_;
    Light light_;
    int level_max_;
    DesignCost cost_;
    MatrixXd covariance_, weighted_;  // C, and A = C diag(lamp weights) C
    VectorXd duty_;
    // Of the row at hand:
    Index row_ = 0;
    double variance_ = 0, level_sum_ = 0, row_covariance_ = 0, row_weighted_ = 0;
    VectorXd row_counts_, card_counts_, along_covariance_, along_weighted_;
};

}  // namespace

Light exchange(const DesignProblem& problem, const Light& start, int level_max, int sweeps) {
    if (!std::isfinite(design_cost(problem, start).cost)) return start;
    Exchange state(problem, start, level_max);
    Light best = start;
    double best_cost = state.cost();
    for (int count = 0; count < sweeps && state.sweep(); ++count) {
        if (!(state.cost() < best_cost * (1 - 1e-6))) {
            if (state.cost() < best_cost) best = state.light();
            break;
        }
        best_cost = state.cost();
        best = state.light();
    }
    return best;
}

}  // namespace ols
