// SPDX-License-Identifier: MIT
// Foretold and found, lamp by lamp.
#include "develop/lamp_witness.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "demultiplex/fill_model.hpp"

namespace ols {

namespace {

double median(std::vector<double> values) {
    const auto middle = values.begin() + ptrdiff_t(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

bool has(const std::vector<int>& images, int image) {
    return std::ranges::find(images, image) != images.end();
}

}  // namespace

LampWitness::LampWitness(const Basis& basis, const std::vector<LightPosition>& lamps)
    : basis_(basis), inverse_(basis.images(), basis.rows) {
    const Eigen::LLT<Eigen::MatrixXd> kernel(smooth_kernel(image_lights(basis, lamps), SmoothPrior{}));
    precision_ = kernel.solve(Eigen::MatrixXd::Identity(basis.images(), basis.images()));
    for (int image = 0; image < basis.images(); ++image)
        for (int row = 0; row < basis.rows; ++row) inverse_(image, row) = basis.inverse(row, image);
}

// What is left out takes the value that the others foretell, all of it at once: the mean of K conditioned on the rest.
Eigen::VectorXd LampWitness::factors(Eigen::VectorXd values, const std::vector<int>& left_out) const {
    const Eigen::VectorXd measured = values;
    double sum = 0;
    for (int image = 0; image < basis_.images(); ++image) sum += has(left_out, image) ? 0 : values(image);
    const double mean = sum / double(basis_.images() - int(left_out.size()));
    values.array() -= mean;
    if (!left_out.empty()) {
        values(left_out).setZero();
        const Eigen::VectorXd pulled = (precision_ * values)(left_out);
        values(left_out) = -Eigen::LLT<Eigen::MatrixXd>(precision_(left_out, left_out)).solve(pulled);
    }
    // In what is left out the quotient is 0, and its value stays the foretold one.
    const Eigen::VectorXd foretold =
        (values.array() - (precision_ * values).array() / precision_.diagonal().array()) + mean;
    return (foretold.array() > light_least * mean).select(measured.array() / foretold.array(), NAN);
}

// The one that is farthest below is left out, and the rest foretold anew: beside a dark lamp its neighbours look bright, and
// those that are dim next to others that are, less dim than they are.
std::vector<LampFinding> LampWitness::find(const Eigen::VectorXd& values, std::vector<int> unknown,
                                           double noise) const {
    const size_t unknown_count = unknown.size();
    std::vector<int>& left_out = unknown;
    for (;;) {
        const Eigen::VectorXd found = factors(values, left_out);
        std::vector<double> off;
        int weakest = -1;
        for (int image = 0; image < basis_.images(); ++image) {
            if (has(left_out, image) || std::isnan(found(image))) continue;
            off.push_back(std::abs(found(image) - 1));
            if (weakest < 0 || found(image) < found(weakest)) weakest = image;
        }
        if (off.size() < 3) return {};
        const double spread = std::max(1.4826 * median(off), noise);
        if (1 - found(weakest) >= sigma_least * spread) {
            if (left_out.size() - unknown_count == size_t(lamps_max)) return {};
            left_out.push_back(weakest);
            continue;
        }
        std::vector<LampFinding> findings;
        for (size_t k = unknown_count; k < left_out.size(); ++k)
            if (const double factor = found(left_out[k]); 1 - factor >= sigma_least * spread)
                findings.push_back({left_out[k], factor, spread, false});
        std::ranges::sort(findings, {}, &LampFinding::factor);
        return findings;
    }
}

std::vector<LampFinding> LampWitness::judge(const ParitySamples& samples) {
    Eigen::VectorXd rows = Eigen::VectorXd::Zero(basis_.rows);
    double variance = 0, count = 0;
    for (Eigen::Index k = 0; k < samples.counts().cols(); ++k) {
        if (samples.variance()(k) <= 0) continue;
        rows += samples.counts().col(k).cast<double>();
        variance += double(samples.variance()(k));
        ++count;
    }
    if (count == 0 || basis_.images() < 3) return {};
    const Eigen::VectorXd values = inverse_ * rows / count;
    const double mean = values.mean();
    if (mean <= 0) return {};
    // Of a lamp's mean, from the camera's noise.
    const double noise = std::sqrt(variance * inverse_.squaredNorm() / double(basis_.images())) / count;
    std::vector<LampFinding> findings = find(values, {}, noise / mean);
    unjudged_ = int(factors(values, {}).array().isNaN().count());
    if (first_.size() == 0) {
        first_ = values;
        return findings;
    }
    // Against the first target: its own pattern over the lamps is divided out, where it was lit.
    Eigen::VectorXd quotients = values.array() / first_.array();
    std::vector<int> unknown;
    for (int image = 0; image < basis_.images(); ++image)
        if (first_(image) <= light_least * first_.mean()) unknown.push_back(image), quotients(image) = 0;
    if (int(unknown.size()) > basis_.images() / 2) return findings;
    // Of the darkest lamp's quotient.
    const double quotient_noise = noise * std::sqrt(2.0) / (light_least * first_.mean());
    for (LampFinding change : find(quotients, unknown, quotient_noise)) {
        change.is_new = true;
        const auto same = std::ranges::find(findings, change.image, &LampFinding::image);
        if (same == findings.end())
            findings.push_back(change);
        else
            *same = change;
    }
    return findings;
}

}  // namespace ols
