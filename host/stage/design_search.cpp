// SPDX-License-Identifier: MIT
// Spectral projected gradient, and which starts are worth it.
#include "stage/design_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "stage/basis_inverse.hpp"
#include "stage/design_starts.hpp"

namespace ols {

namespace {

using Eigen::Index;

constexpr double sufficient_decrease = 1e-4;
constexpr size_t remembered_costs = 10;
constexpr double step_min = 1e-10, step_max = 1e10;

double inner(const Light& a, const Light& b) {
    return (a.array() * b.array()).sum();
}

// Half, or where the parabola through cost and slope has its minimum, if that is not too far from half.
double shortened(double step, double cost, double trial, double slope) {
    const double minimum = -slope * step * step / (2 * (trial - cost - step * slope));
    return std::isfinite(minimum) && minimum > 0.1 * step && minimum < 0.9 * step ? minimum : step / 2;
}

// Down to whole levels, so that no limit is passed; a lamp's level moves by less than 1 / level_max.
Light whole_levels(const DesignProblem& problem, const Light& light, int level_max) {
    const Light nearest = (light * level_max).array().round() / level_max;
    if (is_feasible(problem, nearest)) return nearest;
    return (light * level_max).array().floor() / level_max;
}

// A lamp lit in more rows than its duty allows is dimmed in all of them.
Light within_duty(const DesignProblem& problem, Light light) {
    const double most = problem.duty_max * double(light.rows());
    for (Index i = 0; i < light.cols(); ++i) light.col(i) *= std::min(1.0, most / std::max(light.col(i).sum(), 1e-300));
    return light;
}

}  // namespace

Light descend(const DesignProblem& problem, const Light& start, int steps) {
    Light light = start, best = start;
    DesignCost cost = design_cost(problem, light);
    if (!std::isfinite(cost.cost)) return start;
    Light gradient = design_gradient(problem, light, cost);
    double best_cost = cost.cost, step = 1 / gradient.cwiseAbs().maxCoeff();
    std::deque<double> recent = {cost.cost};
    for (int count = 0; count < steps; ++count) {
        const Light direction = nearest_feasible(problem, light - step * gradient) - light;
        const double slope = inner(direction, gradient);
        if (slope > -1e-9 * cost.cost) break;
        const double ceiling = *std::max_element(recent.begin(), recent.end());
        double along = 1;
        DesignCost trial = design_cost(problem, light + direction);
        while (trial.cost > ceiling + sufficient_decrease * along * slope && along > step_min) {
            along = shortened(along, cost.cost, trial.cost, slope);
            trial = design_cost(problem, light + along * direction);
        }
        if (along <= step_min) break;
        const Light moved = along * direction;
        light += moved;
        const Light turned = design_gradient(problem, light, trial);
        const double curvature = inner(moved, turned - gradient);
        step = curvature > 0 ? std::clamp(moved.squaredNorm() / curvature, step_min, step_max) : step_max;
        gradient = turned;
        cost = std::move(trial);
        recent.push_back(cost.cost);
        if (recent.size() > remembered_costs) recent.pop_front();
        if (cost.cost < best_cost) best_cost = cost.cost, best = light;
    }
    return best;
}

Result<Design> design_basis(const DesignProblem& problem, const DesignOptions& options,
                            const DesignProgress& progress) {
    if (problem.rows < problem.lamps())
        return fail(fmt::format("{} rows cannot tell {} lamps apart: give at least as many rows", problem.rows,
                                problem.lamps()));
    const auto starts = design_starts(problem, options.grey, options.seed);
    std::vector<std::pair<double, size_t>> ranking;
    for (size_t s = 0; s < starts.size(); ++s)
        if (const double cost = design_cost(problem, starts[s].light).cost; std::isfinite(cost))
            ranking.push_back({cost, s});
    if (ranking.empty())
        return fail("even single lamps are brighter than the limits allow: raise the limits or lower the counts");
    std::sort(ranking.begin(), ranking.end());
    ranking.resize(std::min(ranking.size(), size_t(std::max(options.starts, 1))));

    const int level_max = options.grey ? 255 : 1;
    Design best{starts[ranking[0].second].light, level_max, ranking[0].first, starts[ranking[0].second].name};
    for (size_t rank = 0; rank < ranking.size(); ++rank) {
        const DesignStart& start = starts[ranking[rank].second];
        Light light = start.light;
        if (options.grey)
            light =
                whole_levels(problem, within_duty(problem, descend(problem, light, options.descent_steps)), level_max);
        light = exchange(problem, light, level_max, options.exchange_sweeps);
        const double cost = design_cost(problem, light).cost;
        if (cost < best.cost && is_feasible(problem, light)) best = {light, level_max, cost, start.name};
        if (progress) progress(double(rank + 1) / double(ranking.size()), best.cost);
    }
    return best;
}

Result<Basis> basis_of(const Design& design, const std::string& name) {
    Basis basis;
    basis.name = name;
    basis.rows = int(design.light.rows());
    basis.lamps = int(design.light.cols());
    basis.level_max = design.level_max;
    for (Index r = 0; r < design.light.rows(); ++r)
        for (Index i = 0; i < design.light.cols(); ++i)
            basis.levels.push_back(uint8_t(std::lround(design.light(r, i) * design.level_max)));
    return with_least_squares(std::move(basis));
}

}  // namespace ols
