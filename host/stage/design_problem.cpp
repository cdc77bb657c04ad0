// SPDX-License-Identifier: MIT
// Cost, gradient and limits of a designed basis.
#include "stage/design_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace ols {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Below this, the slope of the square root at 0, which is infinite, is cut off: a thousandth of a count is beyond any
// camera.
constexpr double counts_floor = 1e-3;
constexpr double tolerance = 1e-9;

// Points that cover a sphere evenly (the golden spiral), of which the camera sees those with z > 0.
std::vector<Vec3> visible_normals(int count) {
    std::vector<Vec3> normals;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (i + 0.5) / count, radius = std::sqrt(1 - z * z);
        const double turn = 2 * std::numbers::pi * i / std::numbers::phi;
        normals.push_back({radius * std::cos(turn), radius * std::sin(turn), z});
    }
    return normals;
}

// mean over subjects of d sigma^2 / d counts times the subject's lamps: d s_r / d p_r of all rows.
Light row_variance_gradients(const DesignProblem& problem, const MatrixXd& row_counts) {
    const double a = problem.noise.read_counts, b = problem.noise.shot;
    const MatrixXd slopes = (b * b + a * b * row_counts.array().max(counts_floor).rsqrt()) / double(row_counts.cols());
    return slopes * problem.subjects;
}

struct HalfSpaces {
    MatrixXd normals;  // one a row
    VectorXd limits;
};

HalfSpaces half_spaces_of(const DesignProblem& problem) {
    const Index cards = problem.cards.rows(), brightness = problem.brightness_max > 0;
    HalfSpaces half{MatrixXd::Ones(cards + brightness, problem.lamps()), VectorXd(cards + brightness)};
    if (cards) half.normals.topRows(cards) = problem.cards;
    half.limits.head(cards).setConstant(problem.white_counts);
    half.limits.tail(brightness).setConstant(problem.brightness_max);
    return half;
}

bool exceeds(const HalfSpaces& half, const VectorXd& row) {
    return half.limits.size() && ((half.normals * row - half.limits).array() > tolerance * half.limits.array()).any();
}

VectorXd project_row(const HalfSpaces& half, const VectorXd& row) {
    VectorXd point = row.cwiseMax(0).cwiseMin(1);
    if (!exceeds(half, point)) return point;
    const Index sets = half.limits.size();
    MatrixXd corrections = MatrixXd::Zero(row.size(), sets + 1);
    point = row;
    constexpr int sweeps = 60;
    for (int sweep = 0; sweep < sweeps; ++sweep)
        for (Index set = 0; set <= sets; ++set) {
            const VectorXd from = point + corrections.col(set);
            if (set == sets) {
                point = from.cwiseMax(0).cwiseMin(1);
            } else {
                const auto normal = half.normals.row(set).transpose();
                const double excess = std::max(0.0, normal.dot(from) - half.limits(set));
                point = from - normal * (excess / normal.squaredNorm());
            }
            corrections.col(set) = from - point;
        }
    const double ratio = (half.normals * point).cwiseQuotient(half.limits).maxCoeff();
    return ratio > 1 ? VectorXd(point / ratio) : point;
}

}  // namespace

MatrixXd equal_subject(int lamps, double counts) {
    return MatrixXd::Constant(1, lamps, counts);
}

MatrixXd cosine_subjects(const std::vector<LightPosition>& lamps, double counts, int normals) {
    MatrixXd subjects(normals, Index(lamps.size()));
    const auto directions = visible_normals(normals);
    for (Index k = 0; k < normals; ++k)
        for (size_t i = 0; i < lamps.size(); ++i)
            subjects(k, Index(i)) = counts * std::max(0.0, dot(directions[size_t(k)], lamps[i].direction));
    return subjects;
}

double mean_variance(const NoiseModel& noise, const VectorXd& row_counts) {
    return (noise.read_counts + noise.shot * row_counts.array().max(0).sqrt()).square().mean();
}

DesignCost design_cost(const DesignProblem& problem, const Light& light) {
    DesignCost result;
    const MatrixXd row_counts = light * problem.subjects.transpose();
    result.row_variances.resize(light.rows());
    for (Index r = 0; r < light.rows(); ++r) result.row_variances(r) = mean_variance(problem.noise, row_counts.row(r));
    const MatrixXd scaled = result.row_variances.cwiseSqrt().cwiseInverse().asDiagonal() * light;
    MatrixXd information = MatrixXd::Zero(light.cols(), light.cols());
    information.selfadjointView<Eigen::Lower>().rankUpdate(scaled.transpose());
    const Eigen::LLT<MatrixXd> factor(information.selfadjointView<Eigen::Lower>());
    result.cost = std::numeric_limits<double>::infinity();
    if (factor.info() != Eigen::Success || factor.rcond() < 1e-13) return result;
    result.covariance = factor.solve(MatrixXd::Identity(light.cols(), light.cols()));

    const auto variances = result.covariance.diagonal().array();
    const double lamps = double(light.cols()), largest = variances.maxCoeff();
    const double power_mean = (variances / largest).pow(worst_exponent).mean();
    const double worst = largest * std::pow(power_mean, 1 / worst_exponent);
    result.cost = (1 - problem.worst) * variances.mean() + problem.worst * worst;
    result.lamp_weights = (1 - problem.worst) / lamps + problem.worst * worst / (largest * power_mean * lamps) *
                                                            (variances / largest).pow(worst_exponent - 1);
    return result;
}

Light design_gradient(const DesignProblem& problem, const Light& light, const DesignCost& cost) {
    const MatrixXd weighted = cost.covariance * cost.lamp_weights.asDiagonal() * cost.covariance;
    const MatrixXd along = light * weighted;  // row r is (A p_r)'
    const VectorXd inverse = cost.row_variances.cwiseInverse();
    const VectorXd quadratic = (along.array() * light.array()).rowwise().sum();
    const MatrixXd row_counts = light * problem.subjects.transpose();
    return -2 * (inverse.asDiagonal() * along) +
           quadratic.cwiseProduct(inverse.cwiseAbs2()).asDiagonal() * row_variance_gradients(problem, row_counts);
}

bool is_feasible(const DesignProblem& problem, const Light& light) {
    const HalfSpaces half = half_spaces_of(problem);
    for (Index r = 0; r < light.rows(); ++r)
        if (exceeds(half, light.row(r))) return false;
    return light.colwise().sum().maxCoeff() <= problem.duty_max * double(light.rows()) * (1 + tolerance);
}

Light nearest_feasible(const DesignProblem& problem, const Light& light) {
    const HalfSpaces half = half_spaces_of(problem);
    Light nearest(light.rows(), light.cols());
    for (Index r = 0; r < light.rows(); ++r) nearest.row(r) = project_row(half, light.row(r)).transpose();
    return nearest;
}

Light light_of(const Basis& basis) {
    Light light(basis.rows, basis.lamps);
    for (int r = 0; r < basis.rows; ++r)
        for (int lamp = 0; lamp < basis.lamps; ++lamp) light(r, lamp) = basis.light(r, lamp);
    return light;
}

double exposure_share(const DesignProblem& problem, const Light& light) {
    const HalfSpaces half = half_spaces_of(problem);
    double share = 1;
    for (Index set = 0; set < half.limits.size(); ++set)
        share = std::min(share, half.limits(set) / (light * half.normals.row(set).transpose()).maxCoeff());
    return share;
}

double single_cost(const DesignProblem& problem) {
    DesignProblem single = problem;
    single.rows = problem.lamps();
    const MatrixXd light = MatrixXd::Identity(single.rows, single.rows);
    return design_cost(single, exposure_share(problem, light) * light).cost;
}

}  // namespace ols
